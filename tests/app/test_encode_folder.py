"""Test ``eskin encode FOLDER``: event files for the class folders of a slow skin."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from eskin.model.events.recording import Recording
from tests.skins import CLASSES, counts, write_csv, write_skin


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
    "encode skin -o e --time-column none": "contains no sampling rate; add --sample-rate HZ",
    "encode skin/tap/0.csv -o e.npz --workers 2": "--workers is for the recordings of a folder",
    "encode skin/tap/0.csv -o e.npz": "times full scale; subtract the baseline with --baseline first, or add --scale "
    "max",
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
