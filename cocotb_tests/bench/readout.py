"""Driver, monitor and comparison of the readout harness."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from cocotb.triggers import ValueChange
from numpy.typing import NDArray

from eskin.cocotb_tests.bench.analog import SIGNAL_BITS_MORE, Comparators, signal_of
from eskin.model.address_events import EVENT_DTYPE, Events
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import seen
from eskin.model.events.compare import Difference, first_difference

if TYPE_CHECKING:  # importing it would compile the model in every simulator
    from eskin.cocotb_tests.bench.host import Host
    from eskin.model.readout import Stimulus

PATTERN = 65536
"""Length of the harness's ready pattern, a multiple of the length of the stimulus's pattern."""

STUCK = 2**32 - 1
"""Number of errors that the harness reports if no run could begin."""

UNKNOWN = 0xFFFF
"""Address that the harness writes for an unknown address or polarity."""

PACKED = 2**18
"""Largest number of samples that are packed together, so that large arrays need little memory."""


def write_stimulus(
    config: ReadoutConfig,
    folder: Path,
    stimulus: Stimulus,
    comparators: Comparators | None = None,
    record: bool = False,
    host: Host | None = None,
) -> None:
    """Write the files that the harness plays (see harness.v)."""
    stimulus.check(config)
    clocks = np.unique(np.concatenate([stimulus.sample_clock, stimulus.enable_clock, [0]]))
    clocks = clocks[clocks < stimulus.clocks]
    gap = np.diff(clocks, append=stimulus.clocks)
    (comparators or Comparators()).write(config, folder, record)
    with (folder / "stimulus.bin").open("wb") as file:
        size = max(PACKED // config.taxels, 1)
        for start in range(0, len(clocks), size):
            part = slice(start, start + size)
            records = _records(config, stimulus, clocks[part], gap[part])
            file.write(records.tobytes())
        end = np.zeros(records.shape[1], np.uint8)
        end[4] = 0x80
        file.write(end.tobytes())
    ready = np.packbits(_repeat(stimulus.ready, PATTERN), bitorder="little")
    (folder / "ready.bin").write_bytes(ready.tobytes())
    if config.registers != "none":
        (folder / "host.bin").write_bytes(
            bytes(sck + 2 * cs_n + 4 * mosi for sck, cs_n, mosi in (host.pins if host else ()))
        )
    (folder / "ack.bin").write_bytes(_repeat(stimulus.ack_delay, PATTERN // 16).astype(">u2").tobytes())


def _records(
    config: ReadoutConfig, stimulus: Stimulus, clocks: NDArray[np.int64], gap: NDArray[np.int64]
) -> NDArray[np.uint8]:
    """Return the stimulus records that begin at given clocks, shape (clocks, bytes)."""
    tick = np.searchsorted(stimulus.sample_clock, clocks)
    tick_here = np.minimum(tick, max(len(stimulus.sample_clock) - 1, 0))
    if len(stimulus.sample_clock):
        valid = stimulus.sample_clock[tick_here] == clocks
        samples = np.where(valid[:, None], stimulus.samples[tick_here], 0)
    else:
        valid = np.zeros(len(clocks), bool)
        samples = np.zeros((len(clocks), config.taxels), np.int32)
    mask = np.searchsorted(stimulus.enable_clock, clocks, side="right") - 1
    width = config.sample_bits
    if config.frontend == "analog":
        samples, width = signal_of(seen(config, samples)), width + SIGNAL_BITS_MORE
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


def read_events(folder: Path) -> Events:
    """Return the events that the harness recorded."""
    words = np.fromfile(folder / "events.bin", "<u8")
    t, address = words >> np.uint64(16), words.astype(np.uint16)
    if (unknown := np.flatnonzero(address == UNKNOWN)).size:
        raise Mismatch(f"the event in clock {t[unknown[0]]} has an unknown address or polarity (x or z)")
    events = np.empty(len(t), EVENT_DTYPE)
    events["t"], events["y"], events["x"], events["p"] = t, address >> 8 & 0x7F, address & 0xFF, address >> 15
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


@dataclass(frozen=True)
class Outcome:
    """What the harness reports on a run, besides its files."""

    errors: int  # protocol violations of the link, or ``STUCK``
    breach: int  # clock and rule of the first one
    left: int = 0  # of a chip: 1 + the clock from which an event waits at the end, or 0

    @property
    def breaches(self) -> str:
        """Number of protocol violations, and clock and rule of the first one."""
        rule = RULES[self.breach & 7]
        return f"{self.errors} breaches of the protocol, first in clock {self.breach >> 3}: {rule}"


def compare(
    config: ReadoutConfig, name: str, stimulus: Stimulus, folder: Path, outcome: Outcome, reproduce: str
) -> Events:
    """Return the events that the harness recorded in a folder, after comparison with the model.

    Raise Mismatch at the first difference; ``reproduce`` is the command that repeats the run.
    """
    from eskin.model.readout import simulate

    try:
        if outcome.errors == STUCK:
            raise Mismatch("the request stays high or unknown in reset, so no run can begin")
        events = read_events(folder)
    except Mismatch as problem:
        raise Mismatch(f"{problem}; reproduce: {reproduce}") from None
    difference = first_difference(simulate(config, stimulus), events)
    if difference is not None:
        raise Mismatch(f"{name}: {_describe(config, stimulus, difference)}\nreproduce: {reproduce}")
    if outcome.errors:
        raise Mismatch(f"{name}: {outcome.breaches}\nreproduce: {reproduce}")
    return events


def compare_miso(host: Host, name: str, folder: Path, reproduce: str) -> None:
    """Compare MISO and its pad enable in every clock with the model; raise Mismatch at the first difference."""
    played = (folder / "miso.txt").read_text().split()
    wanted = [f"{enable}{level}" for enable, level in zip(host.run.miso_enable, host.run.miso, strict=True)]
    for clock, (found, expected) in enumerate(zip(played, wanted, strict=True)):
        if found != expected:
            raise Mismatch(
                f"{name}: spi_miso_enable and spi_miso are {found} in clock {clock}, and {expected} in the model\n"
                f"reproduce: {reproduce}"
            )


def _describe(config: ReadoutConfig, stimulus: Stimulus, difference: Difference) -> str:
    """Return a text with the first difference, and the model state in the clocks before it."""
    from eskin.model.readout import state_at

    clock, row, column, _ = min(event for event in (difference.a, difference.b) if event is not None)
    first = max(clock - 4, 0)
    lines = ["RTL and model differ", difference.describe(("model", "RTL"))]
    lines.append(f"state of the model before clocks {first} to {clock}, taxel ({row}, {column}):")
    for t in range(first, clock + 1):
        state = state_at(config, stimulus, t)
        lines.append(
            f"  clock {t}: sample {state.sample[row, column]}, reference {state.reference[row, column]}, "
            f"half-width {state.half_width[row, column]}, pending {int(state.pending[row, column])}, "
            f"latch row {state.latch_row} columns {state.latch_columns:#x}, "
            f"requesting rows {np.flatnonzero(state.pending.any(axis=1)).tolist()}"
        )
    return "\n".join(lines)


async def go(dut: Any, skip: bool) -> Outcome:
    """Let the harness play its files after a reset.

    With ``skip`` the harness skips the clocks in which the design is not awake, if it can (see harness.v).
    """
    dut.skipping.value = int(skip)
    dut.go.value = int(dut.done.value) + 1
    await ValueChange(dut.done)
    left = getattr(dut, "left", None)
    return Outcome(int(dut.errors.value), int(dut.breach.value), 0 if left is None else int(left.value))


class Bench:
    """A readout in the harness, for consecutive runs of a cocotb test."""

    def __init__(self, dut: Any, config: ReadoutConfig, folder: Path) -> None:
        self.dut, self.config, self.folder = dut, config, folder

    async def play(self, stimulus: Stimulus, skip: bool = False) -> Events:
        """Play a stimulus, and return the RTL's events (``skip`` as for ``go``)."""
        write_stimulus(self.config, self.folder, stimulus)
        await go(self.dut, skip and bool(stimulus.ready.all()))
        return read_events(self.folder)

    async def check(self, name: str, stimulus: Stimulus, skip: bool = False) -> Events:
        """Play a stimulus, compare RTL and model, and return the events (``skip`` as for ``go``)."""
        write_stimulus(self.config, self.folder, stimulus)
        outcome = await go(self.dut, skip and bool(stimulus.ready.all()))
        return compare(self.config, name, stimulus, self.folder, outcome, "")
