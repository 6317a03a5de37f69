"""Common parts of block-level tests: pins and clock, a checker, and the connection to the simulator."""

from __future__ import annotations

import json
import os
import random
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cocotb.triggers import Timer

from eskin.model.config import ReadoutConfig
from eskin.model.tiles.config import config_of

JOB = "ESKIN_BLOCK_JOB"
"""Environment variable with the job of a block-level test, as JSON."""


class BlockMismatch(AssertionError):
    """A block differs from its reference or violates its contract; the text gives time, place and cause."""


class Block:
    """A block under test: its pins, and the clock made by the bench.

    Everything has a fixed place within a clock, so that all simulators behave equally: inputs change after the
    falling edge, settle, are checked, and only then comes the rising edge.

    Attributes
    ----------
    time : int
        Clocks since the simulation began.
    """

    HALF_PS = 5_000
    SETTLE_PS = 500

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.pins: dict[str, Any] = {}
        self.time = 0
        self.dut.clk.value = 0

    def pin(self, name: str) -> Any:
        """Return the handle of a port, or None if this configuration lacks it."""
        if name not in self.pins:  # looked for once: the simulator takes long to answer, above all to say no
            self.pins[name] = getattr(self.dut, name, None)
        return self.pins[name]

    def drive(self, **values: int) -> None:
        """Set inputs; ignore inputs that this configuration lacks."""
        for name, value in values.items():
            if (pin := self.pin(name)) is not None:
                pin.value = int(value) & (1 << len(pin)) - 1

    def read(self, name: str) -> int:
        """Return an output as an unsigned number; 0 if this configuration lacks it."""
        if (pin := self.pin(name)) is None:
            return 0
        value = str(pin.value)  # a text costs nothing, an array of logic values most of the run
        try:
            return int(value, 2)
        except ValueError:
            raise BlockMismatch(f"clock {self.time}: {name} is {value}") from None

    def read_signed(self, name: str) -> int:
        """Return an output as a signed number."""
        value, bits = self.read(name), len(self.pin(name))
        return value - (value >> (bits - 1) << bits)

    async def settle(self) -> None:
        """Let inputs reach the outputs."""
        await Timer(self.SETTLE_PS, "ps")

    async def edge(self) -> None:
        """Make the rising edge, and the falling one."""
        self.dut.clk.value = 1
        await Timer(self.HALF_PS, "ps")
        self.dut.clk.value = 0
        await Timer(self.HALF_PS, "ps")
        self.time += 1

    async def reset(self, clocks: int = 2) -> None:
        """Hold the reset over some edges."""
        self.drive(rst=1)
        await self.settle()
        for _ in range(clocks):
            await self.edge()
        self.drive(rst=0)
        await self.settle()


class Checker:
    """Compare a block with its expected behaviour, and count every check by name."""

    def __init__(self, block: Block) -> None:
        self.block = block
        self.counts: Counter[str] = Counter()

    def equal(self, name: str, expected: int, got: int, state: object = "") -> None:
        """Compare a signal in this clock."""
        self.counts["checks"] += 1
        if expected != got:
            raise BlockMismatch(f"clock {self.block.time}: {name}: expected {expected}, got {got}; {state}")

    def holds(self, name: str, condition: bool, why: object = "") -> None:
        """Check a named property in this clock."""
        self.counts[name] += 1
        if not condition:
            raise BlockMismatch(f"clock {self.block.time}: {name} is broken; {why}")


class Sink:
    """Ready pattern of a receiver: ``always``, ``random``, ``slow`` (every seventh clock) or ``stuck`` (one stall)."""

    NAMES = ("always", "random", "slow", "stuck")

    def __init__(self, name: str, rng: random.Random) -> None:
        self.name, self.rng, self.clock = name, rng, 0

    def ready(self) -> bool:
        """Return event_ready of the next clock."""
        self.clock += 1
        if self.name == "slow":
            return self.clock % 7 == 0
        if self.name == "stuck" and 30 <= self.clock < 110:
            return False
        return self.name == "always" or self.rng.random() < 0.6


def bits(values: Sequence[object]) -> int:
    """Return true values as set bits, the first in the least significant one."""
    return sum(1 << index for index, value in enumerate(values) if value)


def payload(config: ReadoutConfig, row: int, column: int, polarity: bool) -> dict[str, int]:
    """Return the payload of an event as values of the ports that a configuration has."""
    fields = {"event_row": row, "event_col": column, "event_polarity": int(polarity)}
    present = {
        "event_row": config.row_bits > 0,
        "event_col": config.column_bits > 0,
        "event_polarity": config.has_polarity,
    }
    return {name: value for name, value in fields.items() if present[name]}


def job() -> tuple[ReadoutConfig, random.Random]:
    """Return, within the simulator, the configuration of the test and its source of randomness."""
    fields = json.loads(os.environ[JOB])
    return config_of(fields["config"]), random.Random(fields["seed"])


def report(counts: Counter[str]) -> None:
    """Write the counts for pytest."""
    Path("counts.json").write_text(json.dumps(counts))
