"""Test that the bound properties hold in the delivered Verilog."""

import subprocess
from pathlib import Path
from typing import Any

import pytest

from eskin.cocotb_tests.runner.cocotb_runners import build_environment
from eskin.model.config import ReadoutConfig
from eskin.rtl import yosys
from eskin.rtl.verilog import verilog
from eskin.verify.proofs.bind import checkers, properties
from eskin.verify.proofs.blocks.arbiter import ArbiterChecker
from eskin.verify.proofs.blocks.readout import ReadoutChecker
from eskin.verify.proofs.blocks.registers import HostChecker
from eskin.verify.proofs.checker import Checker

CONFIG = ReadoutConfig(rows=2, columns=2, frontend="analog", link="four_phase")
FLAGS = ("--cc", "--exe", "--build", "--assert", "-Wno-fatal", "-Wno-lint", "-Wno-style", "--top", "bound")
QUICK = ("-MAKEFLAGS", "OPT_FAST=-O0 OPT_SLOW=-O0 OPT_GLOBAL=-O0")


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the delivered readout with its properties, built by Verilator with assertions."""
    folder = tmp_path_factory.mktemp("bound")
    (folder / "eskin_readout.v").write_text(verilog(CONFIG))
    (folder / "properties.sv").write_text(properties(CONFIG))
    own = [str(Path(__file__).with_name(f"bound.{kind}")) for kind in ("sv", "cpp")]
    sources = [*own, "eskin_readout.v", "properties.sv"]
    with build_environment():
        done = subprocess.run(["verilator", *FLAGS, *QUICK, *sources], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return folder / "obj_dir" / "Vbound"


def test_properties_and_assumptions_hold_in_the_delivered_readout(program: Path) -> None:
    done = subprocess.run([program], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert int(done.stdout.split()[0]) > 1000


def test_a_receiver_that_breaks_an_assumption_stops_the_run(program: Path) -> None:
    done = subprocess.run([program, "+impatient"], capture_output=True, text=True)
    assert done.returncode != 0
    assert "Assertion failed" in done.stdout + done.stderr


def test_yosys_reads_properties_and_readout() -> None:
    config = CONFIG.replace(registers="spi")
    files = {"eskin.v": verilog(config).encode(), "properties.sv": properties(config).encode()}
    script = "read_verilog eskin.v; read_verilog -sv -formal properties.sv; hierarchy -check; tee -o said.txt stat"
    assert "$check" in yosys.run(script, "", "said.txt", files)


@pytest.mark.parametrize(("registers", "whole"), [("none", ReadoutChecker), ("spi", HostChecker)])
def test_the_whole_readout_or_its_host_is_bound(registers: str, whole: type[Checker[Any]]) -> None:
    found = list(checkers(CONFIG.replace(registers=registers)))  # a host's test pattern sends events without a step
    assert [type(one) for one, _, _ in found if isinstance(one, (ReadoutChecker, HostChecker))] == [whole]
    arbiter = next(places for one, _, places in found if isinstance(one, ArbiterChecker))
    assert ("host.column_request" in arbiter["request"]) == (whole is HostChecker)


@pytest.mark.command("properties")
def test_the_command_writes_what_goes_with_the_verilog(call: Any, folder: Path) -> None:
    code, _, error = call("dev properties --rows 1 --columns 1 --link four_phase -o out")
    assert code == 0, error
    text = (folder / "out" / "eskin_readout_properties.sv").read_text()
    assert text == properties(ReadoutConfig(rows=1, columns=1, link="four_phase"))
    bound = [line.split()[1] for line in text.splitlines() if line.startswith("bind ")]
    assert bound == ["eskin_taxel", "eskin_link", "eskin_readout", "eskin_readout"]
