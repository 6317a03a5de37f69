"""Test ``sim --data`` and ``replay --data`` with a user's recordings."""

import contextlib
import dataclasses
import os
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from eskin.model.events.recording import Recording
from tests.app.test_simulate import BIT_EXACT, COMMAND, OURS
from tests.conftest import run_eskin as call
from tests.skins import write_skin


def test_a_slow_skin_goes_through_the_rtl(tmp_path: Path) -> None:
    write_skin(tmp_path / "skin", taxels=4, each=1)
    done = call(
        "sim", "--data", tmp_path / "skin", "--encoding", "lcs", "--sim", "icarus", "--ticks", 60, "--textures", 2,
        "-o", tmp_path / "out",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    line = BIT_EXACT.fullmatch(done.stdout.strip().splitlines()[-1])
    assert line is not None
    assert int(line[1]) == 2
    assert int(line[3]) > 0
    folder = tmp_path / "out" / "skin-2x2-lcs-6b"
    rtl, model = Recording.load(folder / "rtl.npz"), Recording.load(folder / "model.npz")
    assert np.array_equal(rtl.events, model.events)
    assert (folder / "raster.png").stat().st_size > 10_000
    kept = {file.relative_to(folder / "events").as_posix() for file in (folder / "events").rglob("*.npz")}
    assert kept == {"press/0.npz", "stroke/0.npz"}
    recording = Recording.load(folder / "events/stroke/0.npz")
    assert (recording.metadata["class"], recording.metadata["name"]) == ("stroke", "stroke/0")
    assert recording.config.sample_rate_hz == 35


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--data", "none"], "none does not exist; give a folder of class folders, or a recording"),
        (
            ["--data", "none", "--dataset", "embedded"],
            "--dataset is for textures, --data plays your own recordings; leave one of the two out",
        ),
        (["--baseline", "median"], "--baseline is for your own recordings; add --data DIR"),
        (["--data", "none", "--textures", 0], "textures and ticks must be at least 1 with --data, not 0, None"),
    ],
)
def test_mistakes_are_one_sentence(arguments: list[str], sentence: str, tmp_path: Path) -> None:
    done = call("sim", *arguments, "-o", tmp_path / "out")
    assert done.returncode == 2
    assert done.stderr == f"error: {sentence}\n"


SKIN = ("replay", "--data", "skin", "--encoding", "lcs", "--baseline", "median")


def files(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*.npz")}


def simulation_of(process: int) -> int | None:
    """Return the simulation that a process runs, or None."""
    with contextlib.suppress(OSError):  # a thread or a child that is just going
        for thread in Path(f"/proc/{process}/task").iterdir():  # a child belongs to the thread that began it
            for child in map(int, (thread / "children").read_text().split()):
                if b"/build/sim/verilator-" in Path(f"/proc/{child}/cmdline").read_bytes():
                    return child
    return None


def test_a_whole_folder_is_replayed_and_a_killed_simulation_costs_nothing_but_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_skin(tmp_path / "skin", taxels=4, each=1)
    monkeypatch.chdir(tmp_path)
    command = [*COMMAND, *SKIN, "--workers", "1", "-o", "out"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ | OURS) as process:
        deadline = time.monotonic() + 120
        while (simulation := simulation_of(process.pid)) is None:
            assert process.poll() is None, "it ended before its simulation could be killed"
            assert time.monotonic() < deadline
            time.sleep(0.01)
        os.kill(simulation, signal.SIGKILL)
        out, _ = process.communicate()
    assert process.returncode == 0, out
    assert "played now: 3 recordings" in out
    events = next(Path("out").glob("*/events"))
    killed = files(events)
    assert set(killed) == {"press/0.npz", "stroke/0.npz", "tap/0.npz"}
    metadata = Recording.load(events / "tap/0.npz").metadata
    assert (metadata["class"], metadata["name"], metadata["source"]) == ("tap", "tap/0", "rtl")
    assert metadata["prepared"]["baseline"] == "median"
    (events / "tap/0.npz").unlink()
    other = Recording.load(events / "press/0.npz")  # of other samples
    dataclasses.replace(other, metadata=other.metadata | {"proof": "another"}).save(events / "press/0.npz")
    again = call(*SKIN, "--workers", 2, "-o", "out")
    assert again.returncode == 0, again.stderr
    assert "played now: 2 recordings" in again.stdout
    line = BIT_EXACT.fullmatch(again.stdout.strip().splitlines()[-1])
    assert line is not None
    assert line[1] == "3"
    assert files(events) == killed


def test_only_one_recording_by_its_name(tmp_path: Path) -> None:
    write_skin(tmp_path / "skin", taxels=4, each=1)
    done = call(*SKIN[:1], "--data", tmp_path / "skin", "--only", "tap/7", "-o", tmp_path / "out")
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1] == "error: skin has no recording 'tap/7'; one of them is press/0"
