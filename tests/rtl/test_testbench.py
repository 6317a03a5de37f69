"""Test the delivered testbenches: they pass on the delivered Verilog, and find a fault in each part of it."""

import re
import subprocess
from pathlib import Path

import pytest

from eskin.cocotb_tests.runner.build_cache import verilog_text
from eskin.cocotb_tests.runner.simulator import require_programs
from eskin.model.bus.config import BusConfig
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.links import registry
from eskin.rtl.gates.clock_gates import BEHAVIOUR, TEST
from eskin.rtl.testbench import testbench as bench_of
from eskin.rtl.text.fold import LONGEST
from eskin.rtl.verilog import Config, verilog

SMALL = ReadoutConfig(rows=2, columns=3, clocks_per_sample=32)
ONE = ReadoutConfig(rows=1, columns=1, encoding="nlcs", link="four_phase", frontend="analog")
CASES: dict[str, tuple[Config, tuple[str, str], str]] = {
    "stream": (SMALL, (r"\.event_ready\(event_ready\)", ".event_ready(1'b1)"), "wrong event in clock"),
    "four_phase": (
        SMALL.replace(link="four_phase", encoding="nlcs-bipolar"),
        (r"if \(rst\) aer_addr", "if (rst | ack_sync) aer_addr"),
        "the address changes in clock",
    ),
    "four_phase_dual": (
        SMALL.replace(link="four_phase_dual", encoding="cw-lcs", reset="async"),
        (r"ack_sync <= ack_meta", "ack_sync <= 1'h1"),
        "only 0 of",
    ),
    "registers": (SMALL.replace(registers="spi"), (r"assign spi_miso = ", "assign spi_miso = ~"), "register 0x0000:"),
    "analog": (SMALL.replace(frontend="analog"), (r"assign on = compare & ", "assign on = "), "wrong event"),
    "analog, registers": (
        SMALL.replace(frontend="analog", encoding="cw-lcs", registers="spi", link="four_phase"),
        (r"assign half_width = {row", "assign half_width = ~{row"),
        "register 0x0020: expected 0x00000014, found 0x00000000",
    ),
    "one taxel": (ONE, (r"aer_req <= setup", "aer_req <= 1'h1"), "event"),
    "frame": (FrameConfig(readout=SMALL), (r"word_sync <= begins", "word_sync <= ~begins"), "wrong word"),
    "one frame": (FrameConfig(readout=ONE), (r"adc_start = ", "adc_start = 0 & "), "a frame_start is not heard"),
    "axi": (
        BusConfig(readout=SMALL.replace(registers="spi"), time_bits=9),
        (r"\.s_axi_rvalid\(s_axi_rvalid\)", ".s_axi_rvalid()"),
        "time-out",
    ),
    "axi, analog": (
        BusConfig(readout=SMALL.replace(frontend="analog")),
        (r"m_axis_tlast <= ~goes_on", "m_axis_tlast <= goes_on"),
        "last 1",
    ),
}
"""Configuration, text of the fault, and what the testbench prints about the fault."""


def played(folder: Path, text: str, bench: str, *more: str) -> tuple[int, str]:
    """Run a testbench in Icarus; return its exit code and output."""
    require_programs("icarus")
    names = []
    for name, content in {"design.v": text, "tb.sv": bench, **{f"{n}.v": t for n, t in enumerate(more)}}.items():
        (folder / name).write_text(content)
        names.append(name)
    built = subprocess.run(
        ["iverilog", "-g2012", "-Wall", "-o", "bench", *names], cwd=folder, capture_output=True, text=True, check=False
    )
    assert (built.returncode, built.stdout + built.stderr) == (0, "")
    done = subprocess.run(["vvp", "-n", "bench"], cwd=folder, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


@pytest.mark.representative("stream", block="testbench")
@pytest.mark.parametrize("name", CASES)
def test_a_testbench_passes_and_finds_a_fault(name: str, tmp_path: Path) -> None:
    config, (right, wrong), found = CASES[name]
    text, bench = verilog_text(config), bench_of(config)
    assert max(map(len, bench.splitlines())) <= LONGEST
    code, said = played(tmp_path, text, bench)
    assert code == 0, said
    assert re.match(r"PASS: \d+ (event|transfer|word)s\n", said)
    faulty, count = re.subn(right, wrong, text)
    assert count
    code, said = played(tmp_path, faulty, bench)
    assert code != 0
    assert found in said
    assert "FAIL" in said


def test_every_link_has_a_testbench() -> None:
    assert set(registry.NAMES) < set(CASES)


def test_a_testbench_keeps_the_clock_gates_working(tmp_path: Path) -> None:
    config = SMALL.replace(registers="spi", encoding="nlcs")
    for design in (config.replace(link="four_phase"), BusConfig(readout=config)):
        code, said = played(tmp_path, verilog(design, gated=True), bench_of(design, TEST), BEHAVIOUR)
        assert (code, said[:5]) == (0, "PASS:")
