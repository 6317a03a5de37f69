"""A skin at the board: its scan against models of the converters, and from the pins to the host's file."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import cocotb
import numpy as np
import pytest
from amaranth.sim import Simulator
from cocotb.triggers import First, ReadOnly, Timer

from eskin.base.errors import InputError
from eskin.board.config import BoardConfig
from eskin.board.gateware import sensor as gateware
from eskin.board.gateware.top import TOP, verilog
from eskin.board.sensor import PARTS, Part, SensorConfig
from eskin.board.session import as_events
from eskin.cocotb_tests.bench.chip import network_of
from eskin.cocotb_tests.bench.line import CLOCK_NS, Line
from eskin.cocotb_tests.runner import cocotb_runners as runners
from eskin.cocotb_tests.runner.simulator import build
from eskin.model.classifier.chip import simulate_chip
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from tests.board.adc import FOLLOWS, Converter
from tests.board.test_gateware import BAUD, JOB, SERIAL, start, weights_of

CLOCK_HZ = 50_000_000
SETTLE_S = 1e-6
TICKS = 40


def samples_of(part: str, codes: np.ndarray, bits: int) -> np.ndarray:
    """Return the signed samples of codes, scaled to a number of bits."""
    own = FOLLOWS.get(part, 12)
    signed = codes.astype(np.int64) - (1 << own - 1)
    return signed << bits - own if bits >= own else signed >> own - bits


def scanned(part: str, codes: np.ndarray, sample_bits: int = 12) -> tuple[list[int], list[int], Converter]:
    """Return the samples of whole scans, the clocks in which scans begin, and the converter."""
    rows, columns = codes.shape[1:]
    config = SensorConfig(part=part, settle_s=SETTLE_S)  # type: ignore[arg-type]
    readout = ReadoutConfig(rows=rows, columns=columns, sample_bits=sample_bits, resolution=4)
    rate = int(CLOCK_HZ / config.scan_clocks(readout, CLOCK_HZ))
    dut = gateware.Scanner(config, readout.replace(sample_rate_hz=rate), CLOCK_HZ)
    converter = Converter(part, codes, SETTLE_S * 1e9)
    samples: list[int] = []
    begun: list[int] = []

    async def bench(ctx: Any) -> None:
        ctx.set(dut.allowed, 1)
        before = clock = 0
        while len(samples) < codes.size:
            now = clock * CLOCK_NS
            pins = [ctx.get(getattr(dut, name)) for name in ("cs_n", "sclk", "mosi", "rows")]
            converter.step(now, *pins)
            ctx.set(dut.miso, converter.miso(now + CLOCK_NS - 1))  # at the next edge
            if pins[3] == 1 and not before:
                begun.append(clock)
            before = pins[3]
            assert not ctx.get(dut.late)
            if ctx.get(dut.valid):
                samples.append(ctx.get(dut.sample))
            await ctx.tick()
            clock += 1

    simulator = Simulator(dut)
    simulator.add_clock(CLOCK_NS * 1e-9)
    simulator.add_testbench(bench)
    simulator.run()
    return samples, begun, converter


@pytest.mark.parametrize(("part", "bits"), [("mcp3008", 12), ("mcp3208", 14), ("ads7953", 8)])
def test_a_scan_gives_the_codes_of_the_converter_at_the_highest_rate(part: str, bits: int) -> None:
    width = FOLLOWS.get(part, 12)
    codes = np.random.default_rng(4).integers(0, 1 << width, (2 if part == "ads7953" else 1, 2, 2))
    codes[0, 0, :2] = 0, (1 << width) - 1
    samples, begun, _ = scanned(part, codes, bits)
    assert samples == (samples_of(part, codes, bits) & (1 << bits) - 1).ravel().tolist()
    assert len(begun) == len(codes)
    assert len(set(np.diff(begun))) == len(codes) - 1


BROKEN: dict[str, tuple[str, dict[str, Any], str]] = {
    "clock": ("mcp3208", {"most_hz": 1.1e6}, "SCLK is too fast"),
    "pause": ("mcp3008", {"pause_s": 100e-9}, "CS is high too shortly"),
    "clock of another": ("ads7953", {"most_hz": 25e6}, "SCLK is too fast"),
    "latency": ("ads7953", {"latency": 1}, ""),
    "null bit": ("mcp3208", {"frame_bits": 18, "first": 0b11 << 16, "channel_bit": 13}, ""),
    "mode": ("ads7953", {"first": 0}, ""),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_scan_that_breaks_the_data_sheet_is_noticed(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    part, changes, sentence = BROKEN[what]
    monkeypatch.setitem(PARTS, part, Part(**(PARTS[part]._asdict() | changes)))
    codes = np.random.default_rng(4).integers(0, 1 << FOLLOWS.get(part, 12), (1, 2, 2))
    if sentence:
        with pytest.raises(AssertionError, match=sentence):
            scanned(part, codes)
    else:
        assert scanned(part, codes)[0] != (samples_of(part, codes, 12) & 0xFFF).ravel().tolist()


@pytest.mark.parametrize(
    ("part", "fields", "sentence"),
    [
        ("mcp3208", {}, "mcp3208 scans 8 x 8 taxels at most 757 times a second, but the network was trained at 20000"),
        ("mcp3008", {"columns": 9, "sample_rate_hz": 10}, "mcp3008 has 8 channels, one for each column; take another"),
        ("ads7953", {"rows": 17, "sample_rate_hz": 10}, "a board drives at most 16 rows of a skin, not 17"),
        ("ads7954", {}, "the converter must be one of mcp3008, mcp3208, ads7953, not 'ads7954'"),
    ],
)
def test_a_skin_that_does_not_fit_is_refused(part: Any, fields: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        SensorConfig(part=part).check(ReadoutConfig(**fields), CLOCK_HZ)


# -- from the pins to the file -----------------------------------------------------------------------


def skin_chip() -> ChipConfig:
    """Return a chip of few taxels at a rate that its converter has."""
    readout = ReadoutConfig(rows=3, columns=4, resolution=5, clocks_per_sample=64)
    network = ClassifierConfig(inputs=24, hidden=20, classes=3, lanes=4, bin_s=0.0003)
    return ChipConfig(readout=readout, classifier=network)


@cocotb.test()
async def a_host_watches_the_skin(dut: Any) -> None:
    """Run a host that loads weights and receives events, while a converter answers at the pins."""
    job = json.loads(Path(os.environ[JOB]).read_text())
    dut.miso.value = 0
    await start(dut)
    converter = Converter("ads7953", np.load(job["codes"]), SETTLE_S * 1e9)
    cocotb.start_soon(at_the_pins(dut, converter))
    line = Line(dut, BAUD)
    words = [sys.executable, "-m", "eskin", *job["words"], "--port", line.port, "--patience", "10"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as host:
        await line.run(host)
        out, err = host.communicate(timeout=60)
    Path("said.json").write_text(json.dumps({"code": host.returncode, "out": out, "err": err}))


async def at_the_pins(dut: Any, converter: Converter) -> None:
    """Connect a converter to the pins of a board."""
    pins = [dut.cs_n, dut.sclk, dut.mosi, dut.rows]
    now, start_ps = 0.0, cocotb.utils.get_sim_time("ps")
    while True:
        await First(*(pin.value_change for pin in pins))
        await ReadOnly()
        now = (cocotb.utils.get_sim_time("ps") - start_ps) / 1000
        converter.step(now, *(int(pin.value) for pin in pins))
        wait = max(converter.valid_at - now, 0)
        await Timer(1, "ps")
        dut.miso.value = converter.miso(now)
        if 0 < wait < CLOCK_NS * 2:
            cocotb.start_soon(later(dut, converter, wait))


async def later(dut: Any, converter: Converter, wait_ns: float) -> None:
    """Give the output of a converter when it is valid."""
    valid_at = converter.valid_at
    await Timer(round(wait_ns * 1000), "ps")
    if converter.valid_at == valid_at:
        dut.miso.value = converter.level


def test_the_classes_of_a_skin_at_the_board_need_no_samples_of_the_host(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runners, "OPTIMISE", "-O0")  # compiling takes longer than the run
    chip = skin_chip()
    rng = np.random.default_rng(5)
    walk = 2048 + np.cumsum(rng.integers(-70, 71, (TICKS, 3, 4)), axis=0)
    codes = walk.clip(0, 4095)
    np.save(tmp_path / "codes.npy", codes)
    weights = weights_of(chip, tmp_path / "weights.npz")
    words = ["play", str(weights), "--sensor", "--limit", str(TICKS), "--out", str(tmp_path / "felt.npz")]
    (tmp_path / "job.json").write_text(json.dumps({"codes": str(tmp_path / "codes.npy"), "words": words}))
    config = BoardConfig(chip=chip, serial=SERIAL, sensor=SensorConfig(part="ads7953", settle_s=SETTLE_S))
    program = build(chip, "verilator", top=TOP, text=verilog(config))
    program.test("tests.board.test_sensor", tmp_path, "a_host_watches_the_skin", {JOB: str(tmp_path / "job.json")})
    said = json.loads((tmp_path / "said.json").read_text())
    assert said["code"] == 0, said
    felt = Recording.load(tmp_path / "felt.npz")
    samples = samples_of("ads7953", codes, 12).reshape(TICKS, -1)
    model = simulate_chip(chip, network_of(chip), samples, felt.duration_clocks)
    assert len(felt.events) > 100
    assert np.array_equal(felt.events, as_events(model.events.tolist()))
    assert f"{len(model.classifier.bins)} bins" in said["out"]
