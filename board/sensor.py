"""Describe a skin at a board: a resistive matrix that an SPI converter scans row by row."""

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

from eskin.base.configuration import Configuration
from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig

PartName = Literal["mcp3008", "mcp3208", "ads7953"]
MAX_ROWS = 16  # rows that the header of the board can drive
MAX_SETTLE_S = 0.01


class Part(NamedTuple):
    """Parameters of an SPI converter at 2.7 to 3.6 V.

    A code is in the last bits of a frame, highest bit first.

    All parts take bits at the rising edge of SCLK, and change their output after the falling edge.
    """

    channels: int
    bits: int
    frame_bits: int  # clocks of SCLK in a frame
    most_hz: float  # largest frequency of SCLK
    pause_s: float  # shortest time between frames, with CS high
    cycle_s: float  # shortest time from frame to frame
    latency: int  # frames from that with a channel's number to that with the channel's code
    first: int  # the frame of channel 0, as a number
    channel_bit: int  # place of the channel's number in the frame


PARTS: dict[str, Part] = {
    # Microchip DS21295: start, single-ended, 3 bits of channel, a clock to sample, a null bit, the code.
    "mcp3008": Part(8, 10, 17, 1.35e6, 270e-9, 0, 0, 0b11 << 15, 12),
    "mcp3208": Part(8, 12, 19, 1e6, 500e-9, 0, 0, 0b11 << 17, 14),  # Microchip DS21298
    # TI SLAS605: manual mode, programmed in each frame; the code of a channel comes two frames later, at most 1 MS/s.
    "ads7953": Part(16, 12, 16, 20e6, 40e-9, 1e-6, 2, 0b0001_1 << 11, 7),
}


@dataclass(frozen=True, kw_only=True)
class SensorConfig(Configuration):
    """A skin at the pins of a board: one output for each row, one channel of the converter for each column."""

    part: PartName
    settle_s: float = 5e-6  # from the drive of a row to its first frame

    def __post_init__(self) -> None:
        self._check_types()
        self._check_range("settle_s", 0, MAX_SETTLE_S)

    def _label(self, name: str) -> str:
        return "the converter" if name == "part" else name

    def check(self, readout: ReadoutConfig, clock_hz: int) -> None:
        """Raise InputError if the converter has too few channels for a readout, or is too slow."""
        if readout.columns > PARTS[self.part].channels:
            raise InputError(
                f"{self.part} has {PARTS[self.part].channels} channels, one for each column; take another converter "
                f"for {readout.columns} columns"
            )
        if readout.rows > MAX_ROWS:
            raise InputError(f"a board drives at most {MAX_ROWS} rows of a skin, not {readout.rows}")
        highest = math.floor(clock_hz / self.scan_clocks(readout, clock_hz))
        if readout.sample_rate_hz > highest:
            raise InputError(
                f"{self.part} scans {readout.rows} x {readout.columns} taxels at most {highest} times a second, but "
                f"the network was trained at {readout.sample_rate_hz:g} Hz; train it at a lower rate"
            )
        if readout.clocks_per_sample * readout.sample_rate_hz > clock_hz:
            raise InputError(
                f"{readout.clocks_per_sample} clocks per sample at {readout.sample_rate_hz:g} Hz need a clock of "
                f"{readout.clocks_per_sample * readout.sample_rate_hz:g} Hz; the board has {clock_hz} Hz"
            )

    def half_clocks(self, clock_hz: int) -> int:
        """Return the clocks of half a period of SCLK."""
        return math.ceil(clock_hz / (2 * PARTS[self.part].most_hz))

    def frame_clocks(self, clock_hz: int) -> int:
        """Return the clocks of a frame, in which CS is low."""
        return (2 * PARTS[self.part].frame_bits + 1) * self.half_clocks(clock_hz)

    def pause_clocks(self, clock_hz: int) -> int:
        """Return the clocks between two frames, in which CS is high."""
        part = PARTS[self.part]
        shortest = math.ceil(part.cycle_s * clock_hz) - self.frame_clocks(clock_hz)
        return max(math.ceil(part.pause_s * clock_hz), shortest, 4)

    def settle_clocks(self, clock_hz: int) -> int:
        """Return the clocks from the drive of a row to its first frame."""
        return max(math.ceil(self.settle_s * clock_hz), 1)

    def scan_clocks(self, readout: ReadoutConfig, clock_hz: int) -> int:
        """Return the clocks of a scan of all rows."""
        frame = self.frame_clocks(clock_hz) + self.pause_clocks(clock_hz)
        frames = readout.columns + PARTS[self.part].latency
        return readout.rows * (self.settle_clocks(clock_hz) + frames * frame) + 1
