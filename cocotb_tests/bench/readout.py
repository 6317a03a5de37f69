"""Driver, monitor and scoreboard of the readout harness."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from cocotb.triggers import ValueChange
from numpy.typing import NDArray

from eskin.cocotb_tests.bench.analog import SIGNAL_BITS_MORE, Comparators, read_decisions, signal_of
from eskin.model.address_events import EVENT_DTYPE, Events
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import seen
from eskin.model.events.compare import Difference, first_difference

if TYPE_CHECKING:  # importing it would compile the model in every simulator
    from eskin.model.readout import Stimulus

PATTERN = 65536
"""Length of the harness's ready pattern, a multiple of the length of the stimulus's pattern."""

STUCK = 2**32 - 1
"""Number of errors that the harness reports if no run could begin."""

UNKNOWN = 0xFFFF
"""Address that the harness writes for an unknown address or polarity."""

PACKED = 2**18
"""Largest number of samples that are packed together, so that large arrays need little memory."""


@dataclass
class StimulusDriver:
    """Writer of stimulus files for the harness (see harness.v)."""

    FILES = ("stimulus.bin", "ready.bin", "ack.bin", "comparators.bin")

    config: ReadoutConfig
    folder: Path

    def write(self, stimulus: Stimulus, comparators: Comparators | None = None) -> None:
        """Write the stimulus files."""
        stimulus.check(self.config)
        clocks = np.unique(np.concatenate([stimulus.sample_clock, stimulus.enable_clock, [0]]))
        clocks = clocks[clocks < stimulus.clocks]
        gap = np.diff(clocks, append=stimulus.clocks)
        (comparators or Comparators()).write(self.config, self.folder, record=comparators is not None)
        with (self.folder / "stimulus.bin").open("wb") as file:
            size = max(PACKED // self.config.taxels, 1)
            for start in range(0, len(clocks), size):
                part = slice(start, start + size)
                records = self._records(stimulus, clocks[part], gap[part])
                file.write(records.tobytes())
            end = np.zeros(records.shape[1], np.uint8)
            end[4] = 0x80
            file.write(end.tobytes())
        ready = np.packbits(_repeat(stimulus.ready, PATTERN), bitorder="little")
        (self.folder / "ready.bin").write_bytes(ready.tobytes())
        (self.folder / "ack.bin").write_bytes(_repeat(stimulus.ack_delay, PATTERN // 16).astype(">u2").tobytes())

    def _records(self, stimulus: Stimulus, clocks: NDArray[np.int64], gap: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Return the stimulus records that begin at given clocks, shape (clocks, bytes)."""
        tick = np.searchsorted(stimulus.sample_clock, clocks)
        tick_here = np.minimum(tick, max(len(stimulus.sample_clock) - 1, 0))
        if len(stimulus.sample_clock):
            valid = stimulus.sample_clock[tick_here] == clocks
            samples = np.where(valid[:, None], stimulus.samples[tick_here], 0)
        else:
            valid = np.zeros(len(clocks), bool)
            samples = np.zeros((len(clocks), self.config.taxels), np.int32)
        mask = np.searchsorted(stimulus.enable_clock, clocks, side="right") - 1
        width = self.config.sample_bits
        if self.config.frontend == "analog":
            samples, width = signal_of(seen(self.config, samples)), width + SIGNAL_BITS_MORE
        words = samples[:, ::-1].astype(">u2" if width <= 16 else ">u4")
        return np.concatenate(
            [
                gap.astype(">u4").view(np.uint8).reshape(-1, 4),
                (valid[:, None] * 0x40).astype(np.uint8),
                _pack(stimulus.enable)[mask],
                words.view(np.uint8),
            ],
            axis=1,
        )


def _pack(bits: NDArray[Any]) -> NDArray[np.uint8]:
    """Pack each row of bits into bytes; the first bit becomes the least significant bit of the last byte."""
    padding = -bits.shape[1] % 8
    return np.packbits(np.pad(bits[:, ::-1].astype(np.uint8), ((0, 0), (padding, 0))), axis=1)


def _repeat(pattern: NDArray[Any], length: int) -> NDArray[Any]:
    if length % len(pattern):
        raise ValueError(f"the length {length} must be a multiple of the pattern length {len(pattern)}")
    return np.tile(pattern, length // len(pattern))


@dataclass
class EventMonitor:
    """Reader of the events recorded by the harness."""

    config: ReadoutConfig
    folder: Path

    def read(self) -> Events:
        """Return the events recorded in events.bin."""
        config = self.config
        words = np.fromfile(self.folder / "events.bin", "<u8")
        t, address = words >> np.uint64(16), words.astype(np.uint16)
        if (unknown := np.flatnonzero(address == UNKNOWN)).size:
            raise Mismatch(f"the event in clock {t[unknown[0]]} has an unknown address or polarity (x or z)")
        if config.handshake:
            column = address & (1 << config.column_bits) - 1
            row = address >> config.column_bits & (1 << config.row_bits) - 1
            polarity = address >> (config.column_bits + config.row_bits) if config.has_polarity else 1
        else:
            column, row, polarity = address & 0xFF, address >> 8 & 0x7F, address >> 15
        events = np.empty(len(t), EVENT_DTYPE)
        events["t"], events["y"], events["x"], events["p"] = t, row, column, polarity
        return events


class Mismatch(AssertionError):
    """Raised if RTL and model differ; the message gives place, difference and repeat command."""


RULES = (
    "both requests are high",
    "the address changes while REQ or ACK is high",
    "REQ rises while ACK is high",
    "REQ falls while ACK is low",
    "an offered event changes or is withdrawn",
)
"""Rules of the link by their number in the harness, in the words of an error message."""


@dataclass
class Scoreboard:
    """Scoreboard that compares the events of RTL and model, and counts equal ones."""

    config: ReadoutConfig
    reproduce: str = ""  # command that repeats the run
    breach: int = 0  # clock and rule of the first protocol violation in the run, from the harness
    # totals of the comparison so far
    runs: int = 0
    clocks: int = 0
    events: int = 0

    def check(
        self, name: str, clocks: int, expected: Events, rtl: Events, errors: int, again: Callable[[], Stimulus]
    ) -> None:
        """Compare the events of a run with those of the model; raise Mismatch at the first difference.

        ``again`` returns the stimulus of the run, for the description of a difference.
        """
        difference = first_difference(expected, rtl)
        if difference is not None:
            raise Mismatch(self._describe(name, again(), difference))
        if errors:
            raise Mismatch(f"{name}: {breaches(errors, self.breach)}\nreproduce: {self.reproduce}")
        self.runs += 1
        self.clocks += clocks
        self.events += len(rtl)

    def _describe(self, name: str, stimulus: Stimulus, difference: Difference) -> str:
        """Return a text with the first difference, the model state at that clock, and the repeat command."""
        from eskin.model.readout import state_at

        clock, row, column, _ = min(event for event in (difference.a, difference.b) if event is not None)
        lines = [f"{name}: RTL and model differ", difference.describe(("model", "RTL"))]
        first = max(clock - 4, 0)
        lines.append(f"state of the model before clocks {first} to {clock}, taxel ({row}, {column}):")
        for t in range(first, clock + 1):
            state = state_at(self.config, stimulus, t)
            lines.append(
                f"  clock {t}: sample {state.sample[row, column]}, reference {state.reference[row, column]}, "
                f"half-width {state.half_width[row, column]}, pending {int(state.pending[row, column])}, "
                f"latch row {state.latch_row} columns {state.latch_columns:#x}, "
                f"requesting rows {np.flatnonzero(state.pending.any(axis=1)).tolist()}"
            )
        return "\n".join([*lines, f"reproduce: {self.reproduce}"])


def breaches(errors: int, first: int) -> str:
    """Return the number of protocol violations of the link, and clock and rule of the first violation."""
    return f"{errors} breaches of the protocol, first in clock {first >> 3}: {RULES[first & 7]}"


@dataclass(frozen=True)
class Prepared:
    """A run whose stimulus and expected events were computed outside the simulator."""

    name: str
    clocks: int
    folder: str
    outstanding: int = 0  # requests that wait at its end
    draw: dict[str, Any] | None = None  # fields of the ``Draw`` of a soak run, which may have no event
    reproduce: str = ""  # command that repeats a mismatch, if not that of the job

    @property
    def expected(self) -> Events:
        """Expected events from the model."""
        events: Events = np.load(Path(self.folder) / "expected.npy")
        return events


class Bench:
    """A readout in the harness, for consecutive runs."""

    def __init__(self, dut: Any, config: ReadoutConfig, folder: Path) -> None:
        self.dut = dut
        self.folder = folder
        self.driver = StimulusDriver(config, folder)
        self.monitor = EventMonitor(config, folder)
        self.scoreboard = Scoreboard(config)

    async def play(self, stimulus: Stimulus, skip: bool = False) -> tuple[Events, int]:
        """Play a stimulus after a reset; return the RTL's events and protocol violations.

        With ``skip`` the harness skips the clocks in which the readout is not awake, if it can (see harness.v).
        """
        self.driver.write(stimulus)
        return await self._go(skip and bool(stimulus.ready.all()))

    async def _go(self, skip: bool = False) -> tuple[Events, int]:
        errors = await self._done(skip)
        try:
            if errors == STUCK:
                raise Mismatch("the request stays high or unknown in reset, so no run can begin")
            return self.monitor.read(), errors
        except Mismatch as problem:
            raise Mismatch(f"{problem}; reproduce: {self.scoreboard.reproduce}") from None

    async def _done(self, skip: bool) -> int:
        self.dut.skipping.value = int(skip)
        self.dut.go.value = int(self.dut.done.value) + 1
        await ValueChange(self.dut.done)
        self.scoreboard.breach = int(self.dut.breach.value)
        return int(self.dut.errors.value)

    async def play_chip(self, stimulus: Stimulus, skip: bool = False) -> int:
        """Play a stimulus on a chip; return protocol violations between readout and classifier.

        With ``skip`` the harness skips the clocks in which the chip is not awake, if it can (see harness.v).
        """
        self.driver.write(stimulus)
        return await self._done(skip)

    async def check(self, name: str, stimulus: Stimulus, skip: bool = False) -> Events:
        """Play a stimulus, compare RTL and model, and return the events (``skip`` as for ``play``)."""
        from eskin.model.readout import simulate

        events, errors = await self.play(stimulus, skip)
        expected = simulate(self.scoreboard.config, stimulus)
        self.scoreboard.check(name, stimulus.clocks, expected, events, errors, lambda: stimulus)
        return events

    async def check_given(self, name: str, stimulus: Stimulus, comparators: Comparators) -> tuple[Events, Stimulus]:
        """Compare RTL and model for recorded comparator decisions; return the events and the stimulus."""
        from eskin.model.readout import simulate

        self.driver.write(stimulus, comparators)
        events, errors = await self._go()
        given = dataclasses.replace(stimulus, decisions=read_decisions(self.scoreboard.config, self.folder))
        expected = simulate(self.scoreboard.config, given)
        self.scoreboard.check(name, stimulus.clocks, expected, events, errors, lambda: given)
        return events, given

    async def check_prepared(self, run: Prepared, again: Callable[[], Stimulus]) -> Events:
        """Play a prepared run and compare RTL and model."""
        for name in StimulusDriver.FILES:
            (self.folder / name).write_bytes((Path(run.folder) / name).read_bytes())
        events, errors = await self._go()
        self.scoreboard.check(run.name, run.clocks, run.expected, events, errors, again)
        return events
