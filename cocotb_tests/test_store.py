"""Test the build cache: an entry is rebuilt if and only if one of its inputs has changed."""

import contextlib
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from eskin.base.errors import InputError
from eskin.cocotb_tests.runner import build_cache as store
from eskin.cocotb_tests.runner import cocotb_runners as runners
from eskin.cocotb_tests.runner import simulator
from eskin.cocotb_tests.runner.build_cache import ROOT
from eskin.model.config import ReadoutConfig

COUNT_YOSYS = """
from eskin.rtl import yosys
run, runs = yosys._start, 0
def counted(*arguments):
    global runs
    runs += 1
    return run(*arguments)
yosys._start = counted
from eskin.cocotb_tests.runner.simulator import build
from eskin.model.config import ReadoutConfig
config = ReadoutConfig(rows=1, columns=2)
program = build(config, "icarus")
print(runs, program.folder)
"""


def copy_packages(folder: Path) -> None:
    """Copy the sources that a build needs."""
    for package in ("base", "model", "rtl", "skin", "cocotb_tests"):
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))


def checkout(folder: Path) -> Path:
    """Return a copy of the parts of the checkout that a build needs."""
    copy_packages(folder)
    shutil.copytree(ROOT / "eskin", folder / "eskin", symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def build_in(folder: Path) -> tuple[int, Path]:
    """Build a readout in a separate process; return the number of Yosys runs, and the folder of the program."""
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


def test_packages_without_a_checkout_build_in_the_users_own_cache(tmp_path: Path) -> None:
    """A build in a folder that others can write to would run planted programs."""
    copy_packages(tmp_path / "site" / "eskin")
    shutil.copy(ROOT / "eskin" / "__init__.py", tmp_path / "site" / "eskin")
    code = "from eskin.cocotb_tests.runner.build_cache import BUILD; print(BUILD)"
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "site"), "ESKIN_CACHE": str(tmp_path / "mine")}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == str(tmp_path / "mine" / "build")


def test_a_program_that_was_planted_is_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulator, "BUILD", tmp_path / "build")
    program = simulator.build(ReadoutConfig(rows=1, columns=1), "icarus")
    assert simulator.build(ReadoutConfig(rows=1, columns=1), "icarus").folder == program.folder
    (program.folder / "planted").touch()
    program.folder.chmod(0o777)  # another user may have changed what lies there
    assert not (simulator.build(ReadoutConfig(rows=1, columns=1), "icarus").folder / "planted").exists()
    others = tmp_path / "others"
    others.mkdir()
    program.folder.parent.rename(others / "sim")
    program.folder.parent.symlink_to(others / "sim")
    with pytest.raises(InputError, match=r"sim cannot be trusted with programs: it cannot be written, is a link, or"):
        simulator.build(ReadoutConfig(rows=1, columns=1), "icarus")


def test_verilators_library_is_compiled_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulator, "BUILD", tmp_path)
    monkeypatch.setattr(runners, "OPTIMISE", "-O0")
    config, flags = ReadoutConfig(rows=1, columns=1), (*runners.VERILATOR_FLAGS, "--coverage-line")
    simulator.build(config, "verilator")
    with simulator.instrumented(simulator.Instruments(flags, store.verilog_text, "", lambda *_: None)):
        log = (simulator.build(config, "verilator").folder / "build.log").read_text()
    assert log.count(" -c -o Vtop__ALL.o ") == 1
    assert set(re.findall(r" -c -o (verilated\w*)\.o ", log)) <= {"verilated_cov"}


def test_a_killed_build_leaves_nothing_that_runs_and_the_next_removes_its_folder(tmp_path: Path) -> None:
    build = """
from eskin.cocotb_tests.runner import simulator
from eskin.cocotb_tests.runner import cocotb_runners as runners
from eskin.model.config import ReadoutConfig
from pathlib import Path
runners.BUILD = simulator.BUILD = Path("build").resolve()
simulator.build(ReadoutConfig(rows=1, columns=1), "verilator")
"""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    killed = subprocess.Popen([sys.executable, "-c", build], cwd=tmp_path, env=environment)
    wait_until(lambda: any("cc1plus" in line for line in running_in(tmp_path)))
    killed.kill()
    killed.wait()
    wait_until(lambda: not running_in(tmp_path))
    (left,) = (tmp_path / "build" / "sim").glob(".*")
    with store.scratch_folder(tmp_path / "build" / "sim", "mine") as mine:
        assert not left.exists()
        with store.scratch_folder(tmp_path / "build" / "sim", "other"):
            assert mine.exists()  # its owner lives
    assert not mine.exists()


def running_in(folder: Path) -> list[str]:
    """Return the command lines of all processes whose working directory is below a folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if (process / "cwd").resolve().is_relative_to(folder):
                found.append((process / "cmdline").read_text())
    return found


def wait_until(happened: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 120
    while not happened():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_the_store_keeps_what_was_used_last(tmp_path: Path) -> None:
    now = time.time()
    for age, name in enumerate(["new", "recent", "old", "older"]):
        (tmp_path / name).mkdir()
        (tmp_path / name / "program").write_bytes(bytes(1_000_000))
        (tmp_path / name / "built").touch()
        used = now - age * 1800 - 60
        os.utime(tmp_path / name / "built", (used, used))
    (tmp_path / ".draft").mkdir()
    store.trim(tmp_path, limit=3_500_000)
    assert sorted(path.name for path in tmp_path.iterdir()) == [".draft", "new", "old", "recent"]
    store.trim(tmp_path, limit=1)  # those of the last hour may be in use
    assert sorted(path.name for path in tmp_path.iterdir()) == [".draft", "new", "recent"]
