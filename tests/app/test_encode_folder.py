"""Test ``eskin encode FOLDER``, and that training, prediction, chip and board apply the scales of the training."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from eskin.base.errors import InputError
from eskin.board.demo import show_of
from eskin.board.stimulus import codes_to_play
from eskin.cocotb_tests.runner.reproduce import own_options
from eskin.cocotb_tests.touch.plan import plan
from eskin.model.classifier.file import IntegerWeights
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.recordings.event_files import signals_of
from eskin.skin.recordings.folder import read_set
from eskin.skin.recordings.options import Preparation
from eskin.skin.recordings.trained_on import OwnReadout
from tests.skins import CLASSES, counts, write_csv, write_skin, write_uneven


def test_a_skin_becomes_one_event_file_per_recording(call: Any, folder: Path) -> None:
    write_skin(folder / "skin", each=2, jitter_s=0.002)
    code, out, err = call("encode skin -o events")
    assert code == 0
    assert "skin: 6 recordings of 3 classes (press, stroke, tap)" in out
    assert "events: 6 event files" in out
    assert "0 events late, 0 decisions merged; reconstruction 3" in out
    assert "the decoder's bound holds" in out
    assert err == ""
    assert "note: 6 of 6 recordings have uneven time stamps and were resampled linearly\n" in out
    files = sorted((folder / "events").rglob("*.npz"))
    assert [file.relative_to(folder / "events").as_posix() for file in files] == [
        f"{kind}/{k}.npz" for kind in CLASSES for k in (0, 1)
    ]
    recordings = [Recording.load(file) for file in files]
    assert [r.metadata["class"] for r in recordings] == [kind for kind in CLASSES for _ in (0, 1)]
    assert len({r.metadata["name"] for r in recordings}) == 6
    assert {r.metadata["dataset"] for r in recordings} == {"skin"}
    assert len({r.config for r in recordings}) == 1
    assert recordings[0].config.sample_rate_hz == pytest.approx(35, rel=0.01)
    assert (recordings[0].config.rows, recordings[0].config.columns) == (4, 4)


def test_a_folder_with_events_of_deleted_recordings_is_refused(call: Any, folder: Path) -> None:
    write_skin(folder / "skin", each=2)
    assert call("encode skin -o e")[0] == call("encode skin -o e")[0] == 0
    (folder / "skin/tap/1.csv").unlink()
    before = {path: path.read_bytes() for path in (folder / "e").rglob("*.npz")}
    code, _, err = call("encode skin -o e --resolution 4")
    what = "1 .npz file that this command would not overwrite (e/tap/1.npz)"
    assert (code, err) == (2, f"error: e contains {what}; choose another --out, or remove the folder\n")
    assert before == {path: path.read_bytes() for path in (folder / "e").rglob("*.npz")}


def test_files_are_the_same_whoever_works_them_out(call: Any, folder: Path) -> None:
    write_skin(folder / "skin", each=2)
    assert call("encode skin -o one --workers 1")[0] == call("encode skin -o three --workers 3")[0] == 0
    made = {
        out: [(path.relative_to(folder / out), path.read_bytes()) for path in sorted((folder / out).rglob("*.npz"))]
        for out in ("one", "three")
    }
    assert len(made["one"]) == 6
    assert made["one"] == made["three"]


def test_a_clock_that_is_too_slow_is_named_with_its_remedy(call: Any, folder: Path) -> None:
    write_skin(folder / "skin", each=1)
    code, out, err = call("encode skin -o events --resolution 8 --clocks-per-sample 64")
    assert code == 0
    assert "the decoder's bound does not hold" in out
    assert "warning: the link is too slow: " in err
    assert "raise --clocks-per-sample above 64, or leave it out" in err


def test_a_single_file_with_time_stamps_is_read_as_one(call: Any, folder: Path) -> None:
    values = counts("tap")
    write_csv(folder / "x.csv", values)
    code, out, _ = call("encode x.csv -o e.npz --baseline first")
    assert code == 0
    assert "note: column 'time_ms' is used as time stamps" in out
    recording = Recording.load(folder / "e.npz")
    assert recording.config.taxels == 16
    rest = values - values[0]
    codes = np.rint(rest * recording.metadata["scale"] * 2048)
    signs = np.where(recording.events["p"], 1, -1)
    taxel = recording.events["y"].astype(int) * 4 + recording.events["x"]
    last = np.bincount(taxel, weights=signs, minlength=16) * 16
    assert np.abs(codes[-1] - last).max() <= 16  # the sum of the events ends within half an LSB of the last sample
    assert math.isclose(recording.metadata["scale"], 2047 / 2048 / np.abs(rest).max(), rel_tol=1e-3)


MISTAKES = {
    "encode none -o e.npz": "none is of unknown kind",
    "encode skin -o taken": "cannot write to taken: it is a file; give the name of a folder",
    "encode skin -o e --class a": "--class is for a single input",
    "encode skin -o e --model functional": "--model functional is for a single input",
    "encode skin -o e --scale p": "--scale needs a percentile such as p99.9",
    "encode skin -o e --scale 0,1": "--scale needs a number other than 0, a number for each taxel such as 0.5,2, max, "
    "per-taxel, or a percentile such as p99.9, not '0,1'\n",
    "encode skin -o e --time-column none": "contains no sampling rate; add --sample-rate HZ",
    "encode skin/tap/0.csv -o e.npz --workers 2": "--workers is for the recordings of a folder",
    "encode skin/tap/0.csv -o e.npz": "outside -2048..2047 of 12 bits; add --sample-bits, or --scale FACTOR",
    "encode skin -o e --baseline highpass --highpass 40": "--highpass must be below half of 35 samples/s",
}


@pytest.mark.parametrize("line", MISTAKES)
def test_mistakes_get_one_sentence_and_leave_nothing(line: str, refuses: Any, folder: Path) -> None:
    write_skin(folder / "skin", each=1)
    (folder / "taken").write_text("")
    refuses(MISTAKES[line], line)


def test_training_refuses_what_is_not_fetched_and_encoding_says_so(call: Any, refuses: Any, folder: Path) -> None:
    write_skin(folder / "skin", each=1)
    (folder / "skin/tap/gone.csv").symlink_to("nowhere")
    what = "1 recordings of skin cannot be read"
    refused = f"error: {what}: skin/tap/gone.csv is a broken link; fetch or remove them, or leave them out with "
    for line in ("train --data skin", "crossval --data skin", "encode skin -o e --strict"):
        refuses(f"{refused}--no-strict\n", line)
    code, out, err = call("encode skin -o e")
    assert (code, "skin: 3 recordings" in out) == (0, True)
    assert err.splitlines()[0] == f"warning: {what} and are left out: skin/tap/gone.csv is a broken link"
    (folder / "e/tap/gone.npz").symlink_to("nowhere")
    what = "event folder e has an entry that is not an event file: e/tap/gone.npz is a broken link"
    assert call("train --events e")[2] == f"error: {what}; fetch or remove it\n"
    what = "--strict is for the recordings of a folder, but x.csv is a single input"
    assert call("encode x.csv -o e.npz --strict")[2] == f"error: {what}; leave --strict out\n"


def test_an_image_of_floats_is_refused(refuses: Any, folder: Path) -> None:
    Image.fromarray(np.random.default_rng(0).random((600, 600)).astype(np.float32)).save(folder / "x.tif")
    refuses("error: x.tif contains floats of unknown scale; save it with 8 or 16 bits\n", "encode x.tif -o e.npz")


# -- a scale for each taxel --------------------------------------------------------------------------


SMALL = "--folds 2 --epochs 10 --set hidden=8 --set batch=4"


@pytest.mark.usefixtures("shorter")
def test_every_command_applies_the_scale_of_each_taxel(folder: Path, call: Any) -> None:
    write_uneven(folder / "skin", each=6)
    write_uneven(folder / "new", each=1, amplitude=0.5, first=20)  # which scales of their own would hide
    code, out, error = call("train --data skin --baseline first", SMALL)
    assert code == 0, error
    said = json.loads(Path("out/train/result.json").read_text())["recordings"]
    scale = np.array(said["scale"])
    assert 0.8e-3 < scale[0] * 1e3 < 1.2e-3 < 0.8 < scale[1] * 1e3 < 1.2
    assert f"\nreadout: {said['readout']['encoding']} {said['readout']['resolution']} b, scale per taxel, " in out

    def expected(path: Path) -> np.ndarray[Any, Any]:
        values = np.loadtxt(path, delimiter=",", skiprows=1)[:, 1:]  # without time stamps
        return np.clip(np.rint((values - values[0]) * scale * 2048), -2048, 2047)

    learned, _ = signals_of(next(Path("out/recordings").glob("skin-*")))
    assert len(learned) == 12
    assert all(np.array_equal(codes, expected(Path(f"skin/{name}.csv"))) for name, codes in learned.items())
    assert call("quantise")[0] == 0
    assert call("predict out/train/weights.npz --data new")[0] == 0
    events = next(Path("out/recordings").glob("new-*"))
    assert {tuple(Recording.load(path).metadata["scale"]) for path in events.glob("*/*.npz")} == {tuple(scale)}
    whole, wanted = (
        Path("out/train/whole.npz"),
        {name: expected(Path(f"new/{name}.csv")) for name in signals_of(events)[0]},
    )
    chip = plan(whole, Path("new"), "", None, None, Path("out/touch"))
    show = show_of(Path("new"), whole)
    assert sorted(chip.names) == sorted(show.names) == sorted(wanted) == ["fast/20", "slow/20"]
    for name, codes in wanted.items():
        assert 500 < np.abs(codes).max() < 1500
        network = IntegerWeights.load(whole)
        played = codes_to_play(network, chip.networks[name].chip.readout, recordings=Path("new"), only=name)
        for found in (signals_of(events)[0][name], chip.image(name), show.load(name)[0], played[1]):
            assert np.array_equal(found, codes)
    code, out, error = call("train --data skin --baseline first --scale max", SMALL, "-o common")
    assert code == 0, error
    common = json.loads(Path("common/result.json").read_text())["recordings"]["scale"]
    assert common == pytest.approx(scale.min())
    assert f" b, scale {common:.4g}\n" in out


@pytest.mark.parametrize("scale", [0.5, [0.5, 2.0], [-0.25, 1e-9, 3.0]])
def test_a_stored_scale_is_that_of_the_training(scale: Any) -> None:
    said = {"readout": ReadoutConfig().to_dict(), "prepared": {"baseline": "first"}, "scale": scale}
    assert OwnReadout.from_dict(said).to_dict() == said


@pytest.mark.parametrize("scale", [[], ["x"], [[1.0]], [0.0, 1.0], [1.0, float("nan")], None, "max", "1,2"])
def test_a_damaged_scale_is_refused(scale: Any) -> None:
    said = {"readout": ReadoutConfig().to_dict(), "prepared": {}, "scale": scale}
    with pytest.raises(InputError, match="the stored preparation, scale and readout are damaged"):
        OwnReadout.from_dict(said)


def test_a_scale_per_taxel_can_be_given(folder: Path, call: Any) -> None:
    write_uneven(folder / "skin", each=1)
    code, out, error = call("encode skin -o events --scale per-taxel")
    assert code == 0, error
    assert "scale per taxel, " in out
    scale = Recording.load(Path("events/fast/0.npz")).metadata["scale"]
    (option,) = own_options(Preparation(), tuple(scale))
    assert option == f"--scale={scale[0]!r},{scale[1]!r}"
    assert call("encode skin -o again", option)[0] == 0
    for kind in ("fast", "slow"):
        events = [Recording.load(Path(place) / kind / "0.npz").events for place in ("events", "again")]
        assert len(events[0]) > 50
        assert np.array_equal(*events)
    code, out, error = call(f"encode skin/fast/0.csv -o one.npz --baseline first {option}")
    assert code == 0, error
    assert "scale per taxel, " in out
    assert Recording.load(Path("one.npz")).metadata["scale"] == scale


def test_factors_for_other_taxels_are_refused(folder: Path) -> None:
    write_uneven(folder / "skin", each=1)
    with pytest.raises(InputError, match=r"0\.csv has 2 taxels, but the scale has 3 factors; choose the same taxels"):
        read_set(Path("skin"), Preparation(scale="1,2,3"), ReadoutConfig())
