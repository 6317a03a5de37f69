"""Test ``eskin decode``, and that the session and the program in docs/guide/files.md give the printed output."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from eskin.model.address_events import make_events
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.model.taxel import error_bound
from eskin.skin.recordings.quality import decode_recording
from tests.app.test_encode import waves
from tests.conftest import without_numbers

SIZE = "--rows 3 --columns 4"


@pytest.mark.parametrize("link", ["stream", "four_phase"])
@pytest.mark.parametrize("encoding", ["lcs", "cw-lcs"])
def test_decodes_within_the_bound(encoding: str, link: str, call: Any, folder: Path) -> None:
    values = waves(taxels=4)
    np.save("x.npy", values)
    line = f"encode x.npy -o e.npz --rows 1 --columns 4 --encoding {encoding} --link {link} --resolution 7"
    line += " --window-period 64" if encoding == "cw-lcs" else ""
    assert call(f"{line} --sample-rate 1000 --clocks-per-sample 20000")[0] == 0
    code, out, err = call("decode e.npz -o y.npz --plot y.png")
    assert (code, err) == (0, "")
    assert out.startswith("y.npz: 400 ticks of 4 taxels at 1000 Hz\nfrom ")
    with np.load(folder / "y.npz") as file:
        assert file["sample_rate_hz"] == 1000
        rebuilt = file["samples"]
    config = Recording.load(folder / "e.npz").config
    low, high = error_bound(config)
    error = np.rint(values * 2048) - rebuilt * 2048
    assert low <= error.min() <= error.max() <= high
    assert Image.open(folder / "y.png").width > 1000


@pytest.mark.command("decode")
def test_all_signal_files_hold_the_same(call: Any, folder: Path) -> None:
    np.save("x.npy", waves())
    call(f"encode x.npy -o e.npz {SIZE} --encoding nlcs --sample-rate 1000")
    for suffix in ("npz", "npy", "csv"):
        assert call(f"decode e.npz -o y.{suffix}")[0] == 0
    signals = decode_recording(Recording.load(folder / "e.npz"))
    assert signals.shape == (400, 12)
    assert np.array_equal(np.load("y.npy"), signals)
    with np.load("y.npz") as file:
        assert np.array_equal(file["samples"], signals)
    assert np.loadtxt("y.csv", delimiter=",", skiprows=1) == pytest.approx(signals, abs=1e-12)
    assert (folder / "y.csv").read_text().startswith("taxel 0,taxel 1,")
    # and each can be encoded again
    for suffix in ("npz", "npy", "csv"):
        rate = "" if suffix == "npz" else "--sample-rate 1000"
        assert call(f"encode y.{suffix} -o {suffix}.npz {SIZE} {rate}")[0] == 0
        assert call(f"compare npz.npz {suffix}.npz")[0] == 0


def test_times_and_names_of_columns_come_back(call: Any, folder: Path) -> None:
    values, rate = waves(100, 4), 50.0
    time = 12.5 + np.arange(100) / rate
    lines = [",".join(f"{number:.6f}" for number in row) for row in np.column_stack([time, values])]
    (folder / "x.csv").write_text("\n".join(["time (s),thumb,index,middle,ring", *lines]) + "\n")
    np.savetxt("bare.csv", values, delimiter=",", header="thumb,index,middle,ring", comments="")
    assert call("encode x.csv -o e.npz --rows 1 --columns 4 --clocks-per-sample 4096")[0] == 0
    assert call("encode bare.csv -o bare.npz --rows 1 --columns 4 --sample-rate 50 --clocks-per-sample 4096")[0] == 0
    assert call("decode e.npz -o y.csv")[0] == 0
    assert call("decode e.npz -o y.npz")[0] == 0
    assert call("decode bare.npz -o bare_again.csv")[0] == 0
    header, first, *_ = (folder / "y.csv").read_text().splitlines()
    assert header == "time_s,thumb,index,middle,ring"
    assert float(first.split(",")[0]) == pytest.approx(12.5)
    with np.load("y.npz") as file:
        assert file["time_s"] == pytest.approx(time)
        assert file["columns"].tolist() == ["thumb", "index", "middle", "ring"]
    assert (folder / "bare_again.csv").read_text().startswith("thumb,index,middle,ring\n")
    assert call("encode y.csv -o again.npz --rows 1 --columns 4 --clocks-per-sample 4096")[0] == 0
    again = Recording.load(folder / "again.npz")
    assert (again.config.sample_rate_hz, again.metadata["start_s"]) == (50.0, 12.5)


def test_a_recording_without_events_decodes_to_silence(call: Any, folder: Path) -> None:
    config = ReadoutConfig(rows=1, columns=2, clocks_per_sample=10)
    for duration, ticks in ((0, 0), (1, 1), (10, 1), (11, 2)):
        Recording(make_events([], 0, 0), config, duration).save(folder / "e.npz")
        assert call("decode e.npz -o y.npy --plot y.png")[0] == 0
        assert np.array_equal(np.load("y.npy"), np.zeros((ticks, 2)))


def test_decode_refuses(refuses: Any, folder: Path) -> None:
    Recording(make_events([], 0, 0), ReadoutConfig(), 2**40).save(folder / "long.npz")
    Recording(make_events([], 0, 0), ReadoutConfig(), 2**10).save(folder / "good.npz")
    (folder / "bad.npz").write_bytes(b"PK")
    for line, sentence in (
        ("none.npz -o y.npy", "cannot read none.npz: No such file or directory"),
        ("bad.npz -o y.npy", "bad.npz is damaged or not an event file; record it again with eskin encode"),
        ("good.npz -o y.wav", "signals are written as .npy, .npz, .csv, not y.wav; rename the output"),
        ("good.npz -o y.npy --plot y.gif", "pictures end in .png, .pdf, .svg, but y.gif does not; rename the output"),
        (
            "long.npz -o y.npy",
            "the recording lasts 17179869184 ticks of 64 taxels, more than decode writes (268435456 values); "
            "cut it into shorter ones",
        ),
    ):
        refuses(f"error: {sentence}\n", "decode", line)


# -- docs/guide/files.md -----------------------------------------------------------------------------


DOCUMENT = Path(__file__).parents[2] / "docs" / "guide" / "files.md"


def block(language: str) -> str:
    (text,) = re.findall(rf"```{language}\n(.*?)```", DOCUMENT.read_text(), re.DOTALL)
    return str(text)


def test_the_session_and_the_program(folder: Path, call: Any) -> None:
    for step in re.split(r"^\$ ", block("console"), flags=re.MULTILINE)[1:]:
        command, _, shown = step.partition("\n")
        if program := re.fullmatch('python -c "(.*)"', command):
            exec(program[1])
            continue
        code, out, err = call(command.removeprefix("eskin "))
        assert (code, err) == (1 if "differ" in shown else 0, ""), command
        told, cut, _ = shown.partition("...\n")
        printed, wanted = without_numbers(out), without_numbers(told)
        assert printed.startswith(wanted) if cut else printed == wanted, command
    assert {"brick.npz", "rebuilt.npz", "rebuilt.png", "slow.npz", "both.png"} <= {
        path.name for path in folder.iterdir()
    }
    values: dict[str, Any] = {}
    exec(block("python"), values)
    assert len(values["time_s"]) > 1000
    assert values["time_s"].max() < 1.0
