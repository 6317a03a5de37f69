"""Behavioural models of SPI converters, from the timing of their data sheets at 2.7 V."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from cocotb.triggers import First, ReadOnly, Timer
from cocotb.utils import get_sim_time
from numpy.typing import NDArray

from eskin.cocotb_tests.bench.line import CLOCK_NS


class Timing(NamedTuple):
    """Limits in ns: a period of SCLK, high and low; MOSI before and behind its rise; CS to its rise; CS high; a cycle.

    ``output`` is the longest time from an edge to the new output.
    """

    period: float
    level: float
    setup: float
    hold: float
    select: float
    pause: float
    cycle: float
    output: float


TIMING = {
    "mcp3008": Timing(1e9 / 1.35e6, 125, 50, 50, 100, 270, 0, 200),
    "mcp3208": Timing(1000, 250, 50, 50, 100, 500, 0, 200),
    "ads7953": Timing(50, 20, 6, 8, 8, 40, 1000, 27),
}
"""Microchip DS21295 and DS21298, section 1; TI SLAS605, timing at 3 V."""

FOLLOWS = {"mcp3008": 10, "mcp3208": 12}  # bits of the code of a converter that answers in the frame of its question


@dataclass
class Converter:
    """A converter behind a resistive matrix."""

    part: str
    codes: NDArray[np.int64]  # shape (scans, rows, columns)
    settle_ns: float  # a row is read no sooner after its drive

    def __post_init__(self) -> None:
        self.limits = TIMING[self.part]
        self.pins = (1, 0, 0, 0)
        self.scan, self.row, self.rises = -1, -1, 0
        self.at = dict.fromkeys(("cs_fall", "cs_rise", "rise", "fall", "mosi", "row"), -1e9)
        self.bits: list[int] = []
        self.out: list[int] = []
        self.level, self.valid_at = 0, -1e9
        self.program = self.due = self.mux = 0

    def miso(self, now: float) -> int:
        """Return the level of the output, which is wrong until the output is valid."""
        return self.level if now >= self.valid_at else 1 - self.level

    def step(self, now: float, cs_n: int, sclk: int, mosi: int, rows: int) -> None:
        """Take the levels of the pins from a time in ns on."""
        before, self.pins = self.pins, (cs_n, sclk, mosi, rows)
        if rows != before[3]:
            self._drive(now, rows)
        if mosi != before[2]:
            assert before[0] or now - self.at["rise"] >= self.limits.hold, "MOSI changes within its hold time"
            self.at["mosi"] = now
        if cs_n != before[0]:
            self._select(now, cs_n)
        if sclk != before[1]:
            assert not cs_n, "SCLK moves while CS is high"
            (self._rise if sclk else self._fall)(now)

    def _drive(self, now: float, rows: int) -> None:
        assert rows & rows - 1 == 0, "two rows are driven at once"
        self.at["row"], self.row = now, rows.bit_length() - 1
        self.scan += rows == 1

    def _select(self, now: float, cs_n: int) -> None:
        if cs_n:
            assert not self.pins[1], "CS rises while SCLK is high"
            self.at["cs_rise"] = now
            if self.part == "ads7953":
                assert len(self.bits) == 16, "a frame has 16 clocks"
                word = int("".join(map(str, self.bits)), 2)
                if word >> 11 == 0b0001_1:
                    self.program = word >> 7 & 15
                    assert not word & 0x7F, "range, power-down and address bits are others"
            return
        assert now - self.at["cs_rise"] >= self.limits.pause, "CS is high too shortly"
        assert now - self.at["cs_fall"] >= self.limits.cycle, "frames follow too closely"
        self.at["cs_fall"], self.bits, self.out, self.rises = now, [], [], 0
        if self.part == "ads7953":
            self._sample(now, self.mux)
            self._shift(now)
            self.due = self.program

    def _sample(self, now: float, channel: int) -> None:
        """Hold a code; its row must have settled."""
        code = 0
        if 0 <= self.row < self.codes.shape[1] and channel < self.codes.shape[2] and self.scan < len(self.codes):
            settled = now - self.at["row"] >= self.settle_ns
            assert settled or self.part == "ads7953", "a row is read before it has settled"
            code = int(self.codes[self.scan, self.row, channel]) if settled else 0
        width = 12 if self.part == "ads7953" else FOLLOWS[self.part]
        self.out = [code >> n & 1 for n in reversed(range(width))]
        if self.part == "ads7953":
            self.out = [channel >> n & 1 for n in reversed(range(4))] + self.out
        else:
            self.out = [0, *self.out]  # the null bit

    def _shift(self, now: float) -> None:
        """Give the next bit, or zero behind the last."""
        self.level, self.valid_at = (self.out.pop(0) if self.out else 0), now + self.limits.output

    def _rise(self, now: float) -> None:
        limits, at = self.limits, self.at
        assert now - at["cs_fall"] >= limits.select, "SCLK rises too soon behind CS"
        assert now - at["rise"] >= limits.period or not self.rises, "SCLK is too fast"
        assert now - at["fall"] >= limits.level or not self.rises, "SCLK is low too shortly"
        assert now - at["mosi"] >= limits.setup, "MOSI changes within its setup time"
        at["rise"], self.rises = now, self.rises + 1
        self.bits.append(self.pins[2])

    def _fall(self, now: float) -> None:
        assert now - self.at["rise"] >= self.limits.level, "SCLK is high too shortly"
        self.at["fall"] = now
        if self.part == "ads7953":
            if self.rises == 2:
                self.mux = self.due
            self._shift(now)
        elif 1 in self.bits:
            since = len(self.bits) - self.bits.index(1)  # clocks, the start bit is the first
            if since == 6:
                start = self.bits.index(1)
                single, *number = self.bits[start + 1 : start + 5]
                assert single, "the frame asks for a difference of channels"
                self._sample(now, number[0] * 4 + number[1] * 2 + number[2])
            if since >= 6:
                self._shift(now)


async def at_the_pins(dut: Any, converter: Converter) -> None:
    """Connect a converter to the pins of a board; its output is wrong until it is valid."""
    pins = [dut.cs_n, dut.sclk, dut.mosi, dut.rows]
    start_ps, wait_ns = get_sim_time("ps"), 0.0
    while True:
        valid = [Timer(round(wait_ns * 1000), "ps")] if 0 < wait_ns < CLOCK_NS * 2 else []
        await First(*(pin.value_change for pin in pins), *valid)
        await ReadOnly()
        now = (get_sim_time("ps") - start_ps) / 1000
        converter.step(now, *(int(pin.value) for pin in pins))
        await Timer(1, "ps")
        now += 1e-3
        wait_ns = converter.valid_at - now
        dut.miso.value = converter.miso(now)
