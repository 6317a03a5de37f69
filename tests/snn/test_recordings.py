"""Test a user's recordings in every command: names from paths, classes from folders."""

import contextlib
import dataclasses
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.app.commands.signals.recordings import events_of
from eskin.base.errors import InputError
from eskin.model.address_events import make_events
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.recordings.event_files import signals_of
from eskin.skin.recordings.options import Preparation
from eskin.skin.recordings.trained_on import OwnReadout
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.frame_steps import FrameSteps
from eskin.snn.data.frames import frames_of_recordings
from eskin.snn.data.recordings import class_of, event_files, read_recordings
from eskin.snn.data.scans import load_recordings
from eskin.snn.exchange.weights import save_weights
from eskin.snn.experiments.points import load_sweep
from studies import fig8, fig9
from studies.networks import trained_networks
from tests.conftest import run_eskin, shorten
from tests.skins import CLASSES as TOUCHES
from tests.skins import counts, write_csv, write_skin
from tests.snn.helpers import some_weights

CLASSES = ("felt", "glass", "wood")
CONFIG = ReadoutConfig(rows=1, columns=3, resolution=4, sample_rate_hz=100.0, clocks_per_sample=10)
BINS = BinConfig(bin_s=0.1)


def touch(kind: str, seed: int, **metadata: Any) -> Recording:
    """Return two seconds in which the taxel of one class is active."""
    generator = np.random.default_rng([CLASSES.index(kind), seed])
    taxel = np.where(generator.random(120) < 0.8, CLASSES.index(kind), generator.integers(0, 3, 120))
    clocks = np.sort(generator.choice(2000, 120, replace=False))
    return Recording(make_events(clocks, 0, taxel, generator.random(120) < 0.5), CONFIG, 2000, metadata=metadata)


@pytest.fixture
def skin(folder: Path) -> Path:
    """Write ten recordings per class, with equal file names in all class folders; return the root folder."""
    for kind in CLASSES:
        (folder / "skin" / kind).mkdir(parents=True)
        for number in range(10):
            touch(kind, number, name=f"{number:02}").save(folder / "skin" / kind / f"{number:02}.npz")
    return folder / "skin"


SMALL = "--bin 0.1 --set hidden=16 --set shift_steps=0 --set batch=4 --set learning_rate=0.01 --epochs 12"


def test_the_class_is_that_of_the_metadata_else_of_the_folder(skin: Path, eskin: Any) -> None:
    touch("felt", 99, **{"class": "felt"}).save(skin / "wood" / "99.npz")
    touch("felt", 98, label="felt").save(skin / "wood" / "98.npz")  # as older event files say it
    data = load_recordings(skin, BINS)
    of = dict(zip(data.names, data.image_labels, strict=True))
    assert of["wood/99"] == of["wood/98"] == CLASSES.index("felt")
    touch("felt", 0).save(skin / "lost.npz")
    with pytest.raises(InputError, match=r"lost\.npz has no class; put it into a folder of its class"):
        load_recordings(skin, BINS)
    shutil.copytree(skin / "felt", "one/felt")
    _, error = eskin("train --events one --bin 0.1 --folds 2", code=2)
    assert error == "error: recordings in one has one class, felt; a classifier needs two at least\n"


def test_scans_of_one_image_stay_together_and_other_files_of_its_name_apart(folder: Path) -> None:
    for row in (0.0, 7.0):
        made = {"class": "felt", "name": "felt/a", "start_row": row, "dataset": "mine"}
        (folder / "all" / f"row-{row:g}").mkdir(parents=True)
        touch("felt", int(row), **made).save(folder / "all" / f"row-{row:g}" / "a.npz")
    touch("felt", 3, **{"class": "felt", "name": "felt/a", "dataset": "other"}).save(folder / "all" / "b.npz")
    for session in ("one", "two"):  # of one name and data set, and not scans of an image
        (folder / "all" / session).mkdir()
        made = {"class": "felt", "name": "felt/c", "dataset": "skin"}
        touch("felt", len(session), **made).save(folder / "all" / session / "c.npz")
    data = load_recordings(folder / "all", BINS)
    assert np.bincount(data.images).tolist() == [1, 1, 2, 1] or sorted(np.bincount(data.images)) == [1, 1, 1, 2]
    assert len(set(data.names)) == 4
    assert {"one/c", "two/c"} <= {name.removeprefix("felt/").removeprefix("skin/felt/") for name in data.names}


def test_a_folder_that_is_no_class_of_the_network_is_no_class(skin: Path) -> None:
    (skin / "new").mkdir()
    touch("felt", 0).save(skin / "new" / "00.npz")
    touch("felt", 1, name="tap/01").save(skin / "new" / "01.npz")
    found = {r.metadata["name"]: class_of(r) for r in read_recordings(event_files([skin]), CLASSES)}
    assert found["new/00"] is found["tap/01"] is None, "a name with a folder stays in another folder"
    assert found["felt/00"] == "felt"
    (alone,) = read_recordings(event_files([skin / "felt" / "00.npz"]), CLASSES)
    assert (alone.metadata["name"], class_of(alone)) == ("felt/00", "felt")


def test_from_class_folders_to_classes(skin: Path, eskin: Any) -> None:
    out, _ = eskin("train", "--events", skin, SMALL, "--folds", 2)
    assert out.startswith(
        f"data: recordings in {skin}\n15 recordings for training (15 scans), 15 for testing, 3 classes;"
    )
    result = json.loads(Path("out/train/result.json").read_text())
    assert result["accuracy"] >= 0.9
    assert (
        f"({sum(a == b for a, b in zip(result['labels'], result['predicted'], strict=True))} of 15 recordings)" in out
    )
    assert "picture and page: out/train/confusion.png, out/train/training.html" in out
    page = Path("out/train/training.html").read_text()
    assert [page.count(f"<h2>{kind}</h2>") for kind in CLASSES] == [1, 1, 1]
    assert page.count('src="data:image/png;base64,') == 4
    tested = [name for name in page.split("<p>") if ": classified as " in name]
    assert all(text.split("/")[0] in CLASSES for text in tested)
    # Another resolution gets a folder of its own; a folder that the user named is refused.
    weights = Path("out/train/weights.npz").read_bytes()
    brief = SMALL.replace("--epochs 12", "--epochs 1")
    other = ("train", "--events", skin, brief, "--folds", 2, "--seed", 1)
    out, error = eskin(*other)
    own = next(line for line in error.splitlines() if line.startswith("out/train holds another training"))
    folder = Path(own.rpartition(" ")[2])
    assert folder.parent == Path("out")
    assert folder.name.startswith("train-recordings-")
    assert (folder / "weights.npz").exists()
    assert Path("out/train/weights.npz").read_bytes() == weights
    assert f"next: eskin quantise {folder}/weights.npz\n" in out
    assert eskin(*other)[1] == error, "called again, it goes on in the same folder"
    _, error = eskin("train", "--events", skin, brief, "--test", "*/0[0-4]", "--seed", 1)
    assert str(folder) not in error, "other test recordings, another folder"
    assert "belongs to another configuration" in eskin(*other, "-o", "out/train", code=2)[1]
    # The studies take textures only: they leave these out, and name the command that makes others.
    with pytest.raises(InputError, match=r"^no network in out/train suits \(out/train.*make one with eskin train$"):
        trained_networks()
    out, _ = eskin("predict", "out/train/weights.npz", "--events", skin)
    assert f"test recordings of the fold: accuracy {result['accuracy']:.1%}" in out
    images = json.loads(Path("out/predictions.json").read_text())["images"]
    assert [image["part"] for image in images].count("test") == 15
    assert {image["name"].split("/")[0] == image["class"] for image in images} == {True}
    shutil.move(skin / "felt" / "00.npz", "00.npz")
    out, _ = eskin("predict", "out/train/weights.npz", "--events", "00.npz")
    assert "class: not known" in out


def test_crossval_and_sweep_take_them(skin: Path, eskin: Any, refuses: Any) -> None:
    eskin("crossval", "--events", skin, SMALL, "--folds", 2, "--seeds", 1, "--workers", 1)
    assert json.loads(Path("out/crossval/result.json").read_text())["last"]["images"] == 30
    shutil.copytree(skin, "again/events")
    both = ("--events", skin, "--events", "again/events")
    eskin("sweep", *both, SMALL, "--folds", 2, "--seeds", 1, "--workers", 1)
    points = load_sweep(Path("out/sweep")).points
    assert [tuple(p[name] for name in ("name", "readout", "resolution", "preset")) for p in points] == [
        ("skin", "lcs", 4, None),
        ("again", "lcs", 4, None),
    ]
    assert points[0]["last"]["accuracy"] == points[1]["last"]["accuracy"] >= 0.9
    assert points[0]["data_rate_bps"] == pytest.approx(120 / 2 * 3)
    assert f"--events {skin}" in load_sweep(Path("out/sweep")).command
    fig9.plot_fig9(fig9.fig9_data([load_sweep(Path("out/sweep"))], "last"), Path("fig9.png"))
    assert Path("fig9.png").stat().st_size > 10_000
    refuses("--points has no effect with --events", "sweep", *both, "--points lcs:2")
    refuses("--preset has no effect with --events", "sweep", *both, "--preset paper")


OWN = f"--data skin --baseline median {SMALL}"


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Train on the tables of a slow skin; return the folder."""
    folder = tmp_path_factory.mktemp("own")
    write_skin(folder / "skin", taxels=4, each=8, jitter_s=0.003)
    (folder / "skin" / "none").mkdir()
    with contextlib.chdir(folder), pytest.MonkeyPatch.context() as patch:
        shorten(patch)
        done = run_eskin(*f"train {OWN} --folds 2".split())
    assert done.returncode == 0, done.stderr
    assert "warning: folder skin/none contains no recording" in done.stderr
    assert "classes: press, stroke, tap" in done.stdout
    assert "event files of skin: out/recordings/skin-" in done.stdout
    assert "note: 24 of 24 recordings have uneven time stamps" in done.stdout
    return folder


@pytest.fixture
def own(trained: Path, folder: Path) -> dict[str, Any]:
    """Copy tables and training into the current folder; return the result."""
    shutil.copytree(trained, folder, dirs_exist_ok=True)
    found: dict[str, Any] = json.loads(Path("out/train/result.json").read_text())
    return found


def test_own_recordings_are_predicted_as_those_of_the_training_were_taken(own: dict[str, Any], eskin: Any) -> None:
    said = own["recordings"]
    assert said["prepared"]["baseline"] == "median"
    assert said["readout"]["sample_rate_hz"] == 35
    assert own["accuracy"] >= 0.9
    out, _ = eskin("predict", "out/train/weights.npz", "--data", "skin")
    assert f"test recordings of the fold: accuracy {own['accuracy']:.1%} (" in out
    (Path("new") / "unheard").mkdir(parents=True)
    for kind in ("tap", "press"):  # at half the height, which a scale of their own would hide
        values = (counts(kind, taxels=4, seed=99) - 10_000) // 2
        write_csv(Path("new") / f"{kind}.csv", values)
    shutil.copy("new/tap.csv", "new/unheard/0.csv")
    out, _ = eskin("predict", "out/train/weights.npz", "--data", "new", "-o", "new.json")
    assert "unheard/0: " in out
    assert out.count("(class: not known)") == 3
    events = [Recording.load(path) for path in sorted(Path("out/recordings").glob("new-*/*.npz"))]
    assert [recording.metadata["scale"] for recording in events] == [said["scale"]] * 2
    assert {recording.config.to_json() for recording in events} == {ReadoutConfig.from_dict(said["readout"]).to_json()}
    eskin("predict", "out/train/weights.npz", "--data", "skin/tap/0.csv")


def test_the_rtl_of_own_recordings_is_held_to_the_model(own: dict[str, Any], eskin: Any) -> None:
    said = own["recordings"]
    recordings = OwnReadout(ReadoutConfig.from_dict(said["readout"]), Preparation(baseline="median")).read(Path("skin"))
    for number in (0, 9):
        made, _ = recordings.recording(number)
        rtl = dataclasses.replace(
            made, metadata=made.metadata | {"source": "rtl", "ticks": len(recordings.codes[number])}
        )
        path = Path("rtl") / f"{made.metadata['name']}.npz"
        path.parent.mkdir(parents=True)
        rtl.save(path)
    check = ("predict", "out/train/weights.npz", "--events", "rtl", "--check-model")
    out, _ = eskin(*check, "--data", "skin")
    assert "2 of 2 images: same events, same tensors, same logits, same predictions" in out
    values = (Path("skin") / "press" / "0.csv").read_text().splitlines()
    cells = values[70].split(",")
    values[70] = ",".join([cells[0], str(int(cells[1]) + 900), *cells[2:]])
    (Path("skin") / "press" / "0.csv").write_text("\n".join(values) + "\n")
    out, _ = eskin(*check, "--data", "skin", code=1)
    assert "press/0: RTL and model differ" in out
    _, error = eskin(*check, code=2)
    assert "press/0 is one of your own recordings; name the folder of its samples with --data" in error


def test_fig8_and_sweep_take_own_recordings(
    own: dict[str, Any], eskin: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InputError, match=r"write the folder of your recordings into RECORDINGS of studies/fig8\.py$"):
        fig8.result().make("fig8", folder)
    monkeypatch.setattr(fig8, "RECORDINGS", Path("skin"))
    monkeypatch.setattr(fig8, "IMAGE", "tap/1")
    path, figure = fig8.result().make("fig8", folder)
    assert figure.stat().st_size > 30_000
    data = json.loads(path.read_text())
    assert (data["image"], data["true"]) == ("tap/1", "tap")
    assert (data["preset"], data["readout"]) == (None, own["recordings"]["readout"])
    again = "--epochs 2 --seeds 1 --workers 1"
    tests = [f"--test */[{numbers}]" for numbers in ("012", "345", "67")]
    sweep = ("sweep", OWN, again, "--points lcs:3,nlcs:4,frame:17.5:8")
    eskin(*sweep, *tests)
    points = load_sweep(Path("out/sweep")).points
    assert [tuple(p[name] for name in ("name", "readout", "resolution", "preset")) for p in points] == [
        ("lcs-3", "lcs", 3, None),
        ("nlcs-4", "nlcs", 4, None),
        ("frame-17.5-8", "frame", 8, None),
    ]
    assert points[2]["data_rate_bps"] == 17.5 * 4 * 8
    cell = json.loads(Path("out/sweep/frame-17.5-8/result.json").read_text())["cells"][1]
    images = load_recordings(next(Path("out/recordings").iterdir()), BinConfig()).names
    assert [images[k] for k in cell["test_images"]] == [f"{kind}/{k}" for kind in TOUCHES for k in (3, 4, 5)]
    _, error = eskin(*sweep, *tests, "--test", "tap/*", "-o", "other", code=2)
    assert "tap/0 fits 2 of the patterns of --test" in error
    assert "--data skin" in load_sweep(Path("out/sweep")).command
    assert "--baseline median" in load_sweep(Path("out/sweep")).command


@pytest.mark.usefixtures("shorter")
def test_a_bin_is_no_shorter_than_a_sample_of_own_recordings(folder: Path, eskin: Any) -> None:
    write_skin(folder / "skin", taxels=4, each=3)
    given = "--encoding lcs --resolution 3 --folds 3 --epochs 1 --set hidden=8"
    out, _ = eskin("train --data skin", given)
    assert "time bin: 0.02857 s, the sample period of these recordings; --bin sets another time bin" in out
    experiment = json.loads(Path("out/train/result.json").read_text())["experiment"]
    assert experiment["bins"]["bin_s"] == 1 / 35


def test_a_frame_is_the_newest_sample(folder: Path) -> None:
    write_skin(folder / "skin", taxels=4, each=1)
    events = events_of(folder / "skin", {"baseline": "first"}, ReadoutConfig(), ())
    codes, rate_hz = signals_of(events)
    assert rate_hz == 35
    for rate, bits, ticks in ((35, 12, np.arange(280)), (10, 5, np.arange(80) * 7 // 2)):
        found = frames_of_recordings(events, FrameSteps.parse(f"frame:{rate}:{bits}", 1 / rate))
        assert (found.names, found.values.shape) == (("press/0", "stroke/0", "tap/0"), (3, len(ticks), 4))
        for values, name in zip(found.values, found.names, strict=True):
            wanted = np.floor(codes[name][ticks] / 2 ** (12 - bits)) / 2 ** (bits - 1)
            assert np.array_equal(values, wanted)
            assert np.ptp(wanted) > 0.1


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("train --baseline median", "--baseline is for your own recordings; add --data DIR"),
        ("train --data skin --frames frame:250:8", "frame:250:8 has more samples or bits than these recordings, 35 s"),
        ("train --data skin --dataset embedded", "--dataset has no effect with --data; leave one of the two out"),
        ("sweep --data skin --points rnn:20", "point rnn-20: frame:5000:10 has more samples or bits than these"),
        ("train --events events --frames frame:25:8", "frames need samples, and event files have none; give"),
        (
            "sweep --data none --points lcs:4",
            "point lcs:4: none is not a folder; give a folder with a sub-folder for each class",
        ),
        ("predict weights.npz", "event folder or file out/replay does not exist; make one with eskin replay"),
        ("predict weights.npz --data skin", "the network was not trained on recordings, so their scale"),
        (
            "predict weights.npz --data skin --check-model",
            "--check-model compares events of the RTL with the model; add",
        ),
        (
            "predict weights.npz --data skin --events skin",
            "--data with --events only names the samples for --check-model",
        ),
    ],
)
def test_options_that_contradict_own_recordings_are_refused(
    words: str, sentence: str, eskin: Any, folder: Path
) -> None:
    write_skin(folder / "skin", taxels=4, each=6)
    save_weights(Path("weights.npz"), some_weights(("press", "stroke", "tap"), 0.1, inputs=8))
    _, error = eskin(words, code=2)
    assert error.count("\n") == 1
    assert error.startswith(f"error: {sentence}")
