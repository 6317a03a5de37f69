"""Test the whole chip from samples to class, and the command touch."""

import dataclasses
import json
import re
import shutil
from pathlib import Path

import pytest

from eskin.cocotb_tests.runner import simulator
from eskin.cocotb_tests.runner.process import MismatchFound
from eskin.cocotb_tests.test_chip import CHIPS
from eskin.cocotb_tests.touch.noise import play
from eskin.cocotb_tests.touch.plan import SHIPPED, Network
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.file import IntegerWeights
from tests.conftest import run_eskin as call

LAST = re.compile(r"touch to class: (\d+) images, (\d+) events, 0 mismatches, (\d+) right")


@pytest.mark.representative("lcs-icarus")
@pytest.mark.parametrize("chip", CHIPS, ids=["lcs-icarus", "nlcs-icarus"])
def test_every_event_potential_and_class_of_a_scan_is_that_of_the_models(chip: ChipConfig, tmp_path: Path) -> None:
    found = play(chip, "icarus", tmp_path)
    assert found["events"] > 100
    assert found["stalls"] > 100
    assert found["bins"] >= 5
    assert found["hidden_spikes"] > 5
    assert found["latency_clocks"] > chip.classifier.hidden
    if chip.classifier.margin:
        assert 1 < found["early"][0] < found["bins"]


FAULTS = {
    "a bit of a weight in the memory": ("weights[loaded]", "weights[loaded] ^ 1", r"bin \(clock, class"),
    "a class that is lost": (
        "if (class_valid) begin",
        "if (class_valid && bin_count != 2) begin",
        r"bin \(clock, class",
    ),
    "samples twice as large": (".sample(sample)", ".sample(sample << 1)", "events differ"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_between_sample_and_class_is_found(fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before, after, words = FAULTS[fault]
    text = simulator.HARNESS.read_text()
    assert before in text
    (tmp_path / "harness.v").write_text(text.replace(before, after))
    monkeypatch.setattr(simulator, "HARNESS", tmp_path / "harness.v")
    monkeypatch.setattr(simulator, "BUILD", tmp_path)
    with pytest.raises(MismatchFound, match=rf"{words}[\s\S]*reproduce: again ONLY=noise"):
        play(CHIPS[0], "icarus", tmp_path)


def test_touch_plays_an_image_once_and_draws_it_from_texture_to_class(tmp_path: Path) -> None:
    command = ("touch", "--only", "brick/brick-00", "-o", tmp_path)
    done = call(*command)
    assert done.returncode == 0, done.stderr
    line = LAST.fullmatch(done.stdout.splitlines()[-1])
    assert line is not None
    assert (line[1], line[3]) == ("1", "1")
    assert int(line[2]) > 1000
    summary = json.loads((tmp_path / "embedded" / "summary.json").read_text())
    assert summary["answers"] == {"brick/brick-00": {"true": "brick", "class": "brick", "float": "brick"}}
    assert (tmp_path / "embedded" / "touch.png").stat().st_size > 50_000
    again = call(*command)
    assert again.stdout.splitlines()[-1] == line[0]
    assert json.loads((tmp_path / "embedded" / "summary.json").read_text())["played_now"]["images"] == 0


def test_every_image_has_a_network_that_has_not_learned_it() -> None:
    for dataset, images in (("embedded", 48), ("kylberg", 240)):
        networks = [Network.load(path) for path in sorted((SHIPPED / dataset).glob("*.npz"))]
        tested = [name for network in networks for name in network.notes.tested]
        assert len(tested) == len(set(tested)) == images


@pytest.mark.command("touch")  # a run takes half a minute
def test_mistakes_are_one_sentence(tmp_path: Path) -> None:
    first = next((SHIPPED / "embedded").glob("*.npz"))
    loaded = IntegerWeights.load(first)
    dataclasses.replace(loaded, notes={}).save(tmp_path / "silent.npz")
    shutil.copy(first, tmp_path / "one.npz")
    torn = {key: said for key, said in loaded.notes["training"].items() if key != "tested"}
    dataclasses.replace(loaded, notes=loaded.notes | {"training": torn}).save(tmp_path / "torn.npz")
    other = loaded.notes["training"]["readout"] | {"rows": 4}
    training = loaded.notes["training"] | {"readout": other}
    dataclasses.replace(loaded, notes=loaded.notes | {"training": training}).save(tmp_path / "other.npz")
    names = (f"brick/brick-{number:02}" for number in range(16))
    foreign = next(name for name in names if name not in loaded.notes["training"]["tested"])
    for arguments, sentence in (
        (["--weights", tmp_path / "none.npz"], "none.npz does not exist; make one with eskin quantise"),
        (["--weights", tmp_path / "silent.npz"], "silent.npz lacks the readout of its training; quantise "),
        (["--weights", tmp_path / "torn.npz"], "torn.npz are damaged; quantise again"),
        (
            ["--weights", tmp_path / "other.npz"],
            "has 128 input channels, but 4 x 8 taxels of lcs have 32 or 64; give the ",
        ),
        (["--weights", tmp_path / "one.npz", "--only", foreign], f"every network here was trained on {foreign}; give"),
        (["--only", "sky"], "dataset embedded has no texture 'sky'; one of them is brick/brick-00"),
        (["--data", tmp_path, "--weights", tmp_path / "one.npz"], "was trained on textures; leave --data out"),
    ):
        done = call("touch", *arguments, "-o", tmp_path.with_name("out"))
        assert done.returncode == 2, done
        assert done.stderr.startswith("error: ")
        assert done.stderr.count("\n") == 1
        assert sentence in done.stderr
