"""A skin at the board: its scan against models of the converters."""

from typing import Any

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.board.gateware import sensor as gateware
from eskin.board.sensor import PARTS, Part, SensorConfig
from eskin.cocotb_tests.bench.line import CLOCK_NS
from eskin.model.config import ReadoutConfig
from tests.board.adc import FOLLOWS, Converter
from tests.board.test_blocks import simulate

CLOCK_HZ = 50_000_000
SETTLE_S = 1e-6


def samples_of(part: str, codes: np.ndarray, bits: int) -> np.ndarray:
    """Return the signed samples of codes, scaled to a number of bits."""
    own = FOLLOWS.get(part, 12)
    signed = codes.astype(np.int64) - (1 << own - 1)
    return signed << bits - own if bits >= own else signed >> own - bits


def scanned(part: str, codes: np.ndarray, sample_bits: int = 12) -> tuple[list[int], list[int]]:
    """Return the samples of whole scans, and the clocks in which scans begin."""
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

    simulate(dut, bench)
    return samples, begun


@pytest.mark.parametrize(("part", "bits"), [("mcp3008", 12), ("mcp3208", 14), ("ads7953", 8)])
def test_a_scan_gives_the_codes_of_the_converter_at_the_highest_rate(part: str, bits: int) -> None:
    width = FOLLOWS.get(part, 12)
    codes = np.random.default_rng(4).integers(0, 1 << width, (2 if part == "ads7953" else 1, 2, 2))
    codes[0, 0, :2] = 0, (1 << width) - 1
    samples, begun = scanned(part, codes, bits)
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
