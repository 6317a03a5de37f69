"""Train, quantise and simulate a classifier in RTL with the project's recordings of a robot finger."""

import json
import re
import shutil
from pathlib import Path

import pytest

from eskin.app.catalogue import COMMANDS
from eskin.app.commands.signals.recordings import FINGER
from eskin.model.classifier.file import IntegerWeights
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.scans import load_recordings
from eskin.snn.experiments.evaluate import early_decisions, integer_classes
from tests.conftest import Call, command

LAST = re.compile(r"touch to class: (\d+) recordings, (\d+) events, 0 mismatches, (\d+) right")


@pytest.mark.usefixtures("shorter")
def test_a_real_finger_goes_from_its_files_to_the_class_of_the_rtl(call: Call, folder: Path) -> None:
    """Run folder, training, prediction, quantisation and chip with default options and a small network."""

    def done(line: str) -> str:
        code, out, err = call(line)
        assert code == 0, err
        return out

    out = done("train --data finger --test *_1 --epochs 40 --set hidden=24")
    assert [line.split("'")[1] for line in out.splitlines() if "is left out" in line] == ["proximity1", "proximity2"]
    assert "12 recordings for training (12 scans), 12 for testing, 4 classes" in out
    assert "logistic regression on statistics of the network's inputs: " in out
    result = json.loads(Path("out/train/result.json").read_text())
    assert {name: one["right"] >= 9 for name, one in result["references"].items()} == {
        "events": True,
        "signals": True,
        "forest": True,
        "most frequent class": False,
    }
    assert result["right"] >= 9
    shutil.copytree(FINGER / "Denim", "new")
    code, _, err = call("touch --data new")
    assert code == 2
    assert "no integer network in out was trained on recordings; run eskin train --data new" in err
    out = done("predict out/train/weights.npz --data new")
    assert out.count("(class: not known)") == 6
    out = done("quantise --accuracy --margin 20000")
    assert f"float {result['right']} of 12 right, integer " in out
    assert re.search(r"early decision: \d+ right after \S+ s on average, \d+ of 12 by the margin", out)
    out = done("touch --data finger --limit 2")
    assert "network: out/train/whole.npz, trained on finger" in out
    line = LAST.fullmatch(out.splitlines()[-1])
    assert line is not None
    assert int(line[2]) > 1000
    summary = json.loads(Path("out/touch/finger/summary.json").read_text())
    answers = summary["answers"]
    data = load_recordings(Path(result["experiment"]["events"]), BinConfig(**result["experiment"]["bins"]))
    assert sorted({data.steps_of(scan) for scan in range(24)}) == [141, 142, 176, 177], (
        "the recordings have unequal lengths"
    )
    images = [data.names.index(name) for name in answers]
    assert [name.endswith("_1") for name in answers] == [True, True], "learned recordings are left out"
    network = IntegerWeights.load(Path("out/train/whole.npz")).network
    whole = integer_classes(network, data, images)
    (decided,) = early_decisions(network, data, images, [network.config.margin])
    assert decided["decided"] == summary["decided"] > 0
    assert decided["right"] == summary["right_early"]
    assert 0 < summary["early_share"] < 1
    assert f"early decisions: {decided['right']} of 2 right after " in out
    assert [answer["class"] for answer in answers.values()] == [data.class_names[found] for found in whole]
    assert [f"{name}: {answer['class']}, " in out for name, answer in answers.items()] == [True, True]
    out = done("predict out/train/whole.npz --data finger")
    images = {one["name"]: one for one in json.loads(Path("out/predictions.json").read_text())["images"]}
    assert {images[name]["part"] for name in answers} == {"test"}
    assert [name for name, one in images.items() if one["part"] == "training"] == [n for n in images if n[-1] == "0"]
    for name, answer in answers.items():
        assert images[name]["predicted"] == answer["class"]
        assert (images[name]["early"], images[name]["early_s"]) == (answer["early"], answer["early_s"])
    assert re.search(r"^early decisions: \d+ of 24 right; \d+ reached the margin$", out, re.MULTILINE)
    code, _, err = call("predict out/train/whole.npz --data finger --metrics")
    assert (code, "--metrics needs the float weights" in err) == (2, True)
    out = done("touch --data new --limit 1")
    name, found = next(iter(json.loads(Path("out/touch/new/summary.json").read_text())["answers"].items()))
    assert found["true"] is None
    assert found["class"] in data.class_names
    early = f"{found['early']} after {found['early_s']:.3g} s"
    assert f"{name}: {found['class']}, early decision: {early}\n" in out
    assert out.splitlines()[-1].endswith(" events, 0 mismatches, true classes not known")


def test_every_command_with_recordings_knows_the_name_of_the_finger(folder: Path) -> None:
    names = [name for name in COMMANDS if any("--data" in option.opts for option in command(name).params)]
    assert {"train", "crossval", "sweep", "sim", "replay", "predict", "touch", "play"} <= set(names)
    for name in names:
        words = [*(["weights.npz", "--port", "none"] if name == "play" else []), "--data", "finger"]
        assert command(name).make_context(name, words).params["data"] == FINGER, name
    assert FINGER in command("demo").make_context("demo", ["finger"]).params.values()
