"""Test shuttle folders: the test passes on the sources and fails on faulty ones, and oversized designs are rejected."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from eskin.flow import programs
from eskin.flow.liberty.library import Library
from eskin.flow.tapeout.folder import TEMPLATES, plan
from eskin.flow.tapeout.pins import readout_for
from eskin.flow.tapeout.shuttles import SHUTTLES
from eskin.model.config import ReadoutConfig
from eskin.rtl.registers.loader import SampleLoader
from eskin.rtl.verilog import block_rtlil, block_verilog
from eskin.verify.proofs.delivered import prove
from tests.conftest import Call

BASE = "tapeout --author N --rows 2 --columns 2"


def played(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the test of a folder with its own Makefile."""
    outer = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "PYTEST", "COCOTB"))}
    environment = outer | {
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    return subprocess.run(["make", "-C", folder / "test"], env=environment, capture_output=True, text=True, check=False)


def test_the_folders_own_test_passes_and_finds_a_wrong_pin(call: Call, folder: Path) -> None:
    code, said, error = call(f"{BASE} --shuttle tt-ihp --size 1x2 -o chip")
    assert (code, error) == (0, "")
    assert "clock 5.12 MHz" in said
    assert "unchecked whether the cells fit: add --lib TYP.lib" in said
    passes(folder / "chip")
    source = folder / "chip/src/tt_um_eskin_readout.v"
    source.write_text(source.read_text().replace(".mosi(ui_in[1])", ".mosi(~ui_in[1])"))
    done = played(folder / "chip")
    assert done.returncode != 0
    assert "AssertionError: event 0: expected [clock, request, address] [" in done.stdout, done.stdout[-3000:]


def test_a_core_between_pads_and_two_requests(call: Call, folder: Path) -> None:
    line = f"{BASE} --shuttle wafer-gf180 --size 1x1 --link four_phase_dual --encoding nlcs-bipolar -o chip"
    assert call(line)[0] == 0
    passes(folder / "chip")


def passes(folder: Path) -> None:
    """Check that the test of a folder passes with events."""
    done = played(folder)
    assert done.returncode == 0, done.stdout[-3000:]
    events = json.loads((folder / "test/expected.json").read_text())["events"]
    assert len(events) > 20
    assert f"{len(events)} events, all as the golden model says" in done.stdout


def test_the_loaders_text_is_the_rtl() -> None:
    loader = SampleLoader(ReadoutConfig(rows=2, columns=2, reset="async"))
    text = block_verilog(loader)
    assert prove(block_rtlil(loader), text)["eskin_loader"] > 48
    assert text.count("async_reg") == 3  # SCK, CS and MOSI are asynchronous


@pytest.mark.command("tapeout")
def test_tiny_tapeout_finds_all_its_files(call: Call, folder: Path) -> None:
    assert call(f"{BASE} --shuttle tt-sky --size 2x2 --top tt_um_skin -o chip")[0] == 0
    info = (folder / "chip/info.yaml").read_text()
    pins = {f"{group}[{bit}]" for group in ("ui", "uo", "uio") for bit in range(8)}
    assert {line.split(":")[0].strip() for line in info.splitlines() if "[" in line} == pins
    assert 'top_module: "tt_um_skin"' in info
    assert all((folder / "chip/src" / line.split('"')[1]).is_file() for line in info.splitlines() if "- " in line)
    assert json.loads((folder / "chip/src/config.json").read_text())["CLOCK_PERIOD"] == pytest.approx(
        195.312, abs=0.001
    )


def test_the_packages_of_the_test_are_those_of_the_project() -> None:
    pinned = (TEMPLATES / "requirements.txt").read_text().split()
    assert {one.split("==")[0] for one in pinned} == {"cocotb", "pytest"}
    constraints = Path(__file__).parents[2] / "constraints.txt"
    assert set(pinned) <= set(constraints.read_text().splitlines())


@pytest.mark.skipif(shutil.which("sta") is None, reason="OpenSTA is not installed: apt-get install opensta")
def test_every_pin_of_tiny_tapeout_has_a_constraint(library: Library, folder: Path) -> None:
    config = readout_for(ReadoutConfig(rows=1, columns=2), frozenset(), SHUTTLES["tt-ihp"])
    made, cells = plan(config, SHUTTLES["tt-ihp"], library, "2x2", "tt_um_skin", "N", "T")
    assert cells is not None
    made.write(folder, cells)
    constant = {f"uo_out[{bit}]" for bit in range(4, 8)} | {"uo_out[3]"} | {f"uio_oe[{bit}]" for bit in range(8)}
    constant |= {f"uio_out[{bit}]" for bit in range(config.address_bits, 8)}
    text = (folder / "src/project.sdc").read_text()
    asynchronous = {"rst_n", *(f"ui_in[{bit}]" for bit in range(5))}  # false paths, without an input delay
    found = complaints(cells.netlist, library, text) - constant
    assert {pin for pin in found if "/" not in pin} == asynchronous
    assert len(found - asynchronous) == 1  # the first flop of the reset, whose input is constant
    assert "uo_out[0]" in complaints(cells.netlist, library, text.replace("{uo_out[*] ", "{"))


def complaints(netlist: str, library: Library, constraints: str) -> set[str]:
    """Return the pins that OpenSTA finds without a constraint; check that the clock is met."""
    script = (
        "read_liberty cells.lib; read_verilog netlist.v; link_design tt_um_skin; source project.sdc; "
        'check_setup -verbose; puts "SLACK <<[worst_slack -max]>>"'
    )
    files = {"cells.lib": library.content, "netlist.v": netlist, "project.sdc": constraints}
    said = programs.opensta(script, files)
    assert said.status == 0, said.text
    assert 0 < float(said.values["SLACK"]) < 1000, said.text
    return {line.strip() for line in said.text.splitlines() if line.startswith(" ")}


@pytest.mark.parametrize("path", ["/usr/bin:/bin", f"{Path(sys.executable).parent}:/usr/bin:/bin"])
def test_the_printed_line_finds_cocotb(call: Call, folder: Path, path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", path)
    _, out, _ = call(f"{BASE} --shuttle tt-sky --size 2x2 -o chip")
    line = out.rstrip().rpartition("; test: ")[2]
    done = subprocess.run(f"{line} -n", shell=True, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "test" in done.stdout


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ("--shuttle tt-xx --size 1x1", "--shuttle must be one of tt-ihp, tt-sky, wafer-gf180"),
        ("--shuttle tt-ihp", "the size of the chip is unknown: add --lib typ.lib, or --size 1x1"),
        ("--shuttle tt-ihp --size 9x9", "tt-ihp has the sizes 1x1,"),
        ("--shuttle tt-ihp --size 1x1 --link stream", "need --link four_phase or four_phase_dual, not stream"),
        ("--shuttle tt-ihp --size 1x1 --frontend analog", "need --frontend digital, not analog"),
        ("--shuttle tt-ihp --size 1x1 --top skin", "--top must begin with tt_um_"),
        ("--shuttle tt-ihp --size 8x2 --rows 32 --columns 32", "has 11 bits, but there are 8 pins"),
        ("--shuttle tt-ihp --size 8x2 --rows 8 --columns 8", "use --sample-rate 12207 or less"),
    ],
)
def test_a_design_that_no_shuttle_takes_is_refused_in_one_sentence(
    call: Call, folder: Path, options: str, sentence: str
) -> None:
    code, _, error = call(f"{BASE} {options} -o chip")
    assert code == 2
    assert error.count("\n") == 1
    assert sentence in error
    assert not list(folder.iterdir())
