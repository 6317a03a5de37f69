"""``sim --data``: a user's own recordings through RTL and model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cocotb_tests.test_commands import BIT_EXACT, call
from model.events.recording import Recording
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
        (["--data", "none", "--only", "a"], "--data plays your own recordings; leave out --only and --dataset"),
        (["--data", "none", "--textures", 0], "textures and ticks must be at least 1 with --data, not 0, None"),
    ],
)
def test_mistakes_are_one_sentence(arguments: list[str], sentence: str, tmp_path: Path) -> None:
    done = call("sim", *arguments, "-o", tmp_path / "out")
    assert done.returncode == 2
    assert done.stderr == f"error: {sentence}\n"
