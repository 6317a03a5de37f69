"""Common parts of block-level testbenches: pins, clock, checker, and link to pytest."""

import json
import os
import pickle
import random
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import cocotb
from cocotb.triggers import Timer

from eskin.model.config import ReadoutConfig
from eskin.model.tiles.config import config_of

Simulator = Literal["verilator", "icarus"]
JOB = "ESKIN_BLOCK_JOB"
"""Environment variable with the job of a block-level test, as JSON."""


class BlockMismatch(AssertionError):
    """Raised if a block differs from its reference or violates a property."""


class Block:
    """A block under test with its pins and clock.

    Everything has a fixed place within a clock, so that all simulators behave equally: inputs change with the falling
    edge, settle, are checked, and only then comes the rising edge. A clock takes two time steps, and inputs that keep
    their values are not written, because steps and writes are most of the time of a run.
    """

    HALF_PS = 5_000

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.pins: dict[str, Any] = {}
        self.driven: dict[str, int] = {}
        self.settled = False
        self.time = 0  # clocks since the simulation began
        self.past: deque[str] = deque(maxlen=4)  # inputs of the last clocks
        self.dut.clk.value = 0

    def pin(self, name: str) -> Any:
        """Return the handle of a port, or None if the configuration lacks the port."""
        if name not in self.pins:  # cached: the simulator is slow to look up a port, above all a missing port
            self.pins[name] = getattr(self.dut, name, None)
        return self.pins[name]

    def drive(self, **values: int) -> None:
        """Set input ports; ports that the configuration lacks are ignored.

        A value that the last call has already written is skipped; so no other function may write the same port later.
        """
        for name, value in values.items():
            if self.driven.get(name) != value and (pin := self.pin(name)) is not None:
                self.driven[name], self.settled = value, False
                pin.value = int(value) & (1 << len(pin)) - 1

    def read(self, name: str) -> int:
        """Return an output as an unsigned number; 0 if the configuration lacks the port."""
        if (pin := self.pin(name)) is None:
            return 0
        value = str(pin.value)  # reading a text is fast; an array of logic values would take most of the run
        try:
            return int(value, 2)
        except ValueError:
            raise self.mismatch(f"{name} is {value}") from None

    def mismatch(self, text: str) -> BlockMismatch:
        """Return the exception for a difference in this clock, with the inputs before it and the command."""
        lines = [f"clock {self.time}: {text}", "inputs:", *self.past, f"  clock {self.time}: {self.driven}"]
        if test := os.environ.get("PYTEST_CURRENT_TEST"):
            lines.append(f"reproduce: python -m pytest '{test.removesuffix(' (call)')}'")
        return BlockMismatch("\n".join(lines))

    def read_signed(self, name: str) -> int:
        """Return an output as a signed number."""
        value, bits = self.read(name), len(self.pin(name))
        return value - (value >> (bits - 1) << bits)

    async def settle(self) -> None:
        """Wait until the outputs follow the inputs, while the clock is low."""
        if not self.settled:
            await Timer(self.HALF_PS, "ps")
            self.settled = True

    async def edge(self) -> None:
        """Generate a rising and a falling clock edge; the falling edge takes effect with the next wait."""
        await self.settle()
        self.past.append(f"  clock {self.time}: {self.driven}")
        self.dut.clk.value = 1
        await Timer(self.HALF_PS, "ps")
        self.dut.clk.value = 0
        self.settled = False
        self.time += 1

    async def reset(self, clocks: int = 2) -> None:
        """Assert the reset for a number of clocks."""
        self.drive(rst=1)
        await self.settle()
        for _ in range(clocks):
            await self.edge()
        self.drive(rst=0)
        await self.settle()


class Checker:
    """Checker that compares outputs with expected values and counts checks by name."""

    def __init__(self, block: Block) -> None:
        self.block = block
        self.counts: Counter[str] = Counter()

    def equal(self, name: str, expected: int, got: int, state: object = "") -> None:
        """Compare a signal with its expected value."""
        self.counts["checks"] += 1
        if expected != got:
            raise self.block.mismatch(f"{name}: expected {int(expected)}, got {got}; {state}")

    def outputs(self, state: object, **expected: int) -> None:
        """Compare output ports with their expected values; 0 is expected of a port that the configuration lacks."""
        for name, value in expected.items():
            pin = self.block.pin(name)
            self.equal(name, value if pin is None else value & (1 << len(pin)) - 1, self.block.read(name), state)

    def holds(self, name: str, condition: bool, why: object = "") -> None:
        """Check a named property in this clock."""
        self.counts[name] += 1
        if not condition:
            raise self.block.mismatch(f"{name} is broken; {why}")


class Sink:
    """Ready pattern of a sink: ``always``, ``random``, ``slow`` (every seventh clock) or ``stuck`` (one long stall)."""

    NAMES = ("always", "random", "slow", "stuck")

    def __init__(self, name: str, rng: random.Random) -> None:
        self.name, self.rng, self.clock = name, rng, 0

    def ready(self) -> bool:
        """Return the level of event_ready in the next clock."""
        self.clock += 1
        if self.name == "slow":
            return self.clock % 7 == 0
        if self.name == "stuck" and 30 <= self.clock < 110:
            return False
        return self.name == "always" or self.rng.random() < 0.6


def bits(values: Sequence[object]) -> int:
    """Return Booleans as bits of an integer, the first in the least significant bit."""
    return sum(1 << index for index, value in enumerate(values) if value)


def payload(config: ReadoutConfig, row: int, column: int, polarity: int) -> dict[str, int]:
    """Return the payload fields of an event, limited to existing ports."""
    fields = {"event_row": row, "event_col": column, "event_polarity": polarity}
    present = {
        "event_row": config.row_bits > 0,
        "event_col": config.column_bits > 0,
        "event_polarity": config.has_polarity,
    }
    return {name: value for name, value in fields.items() if present[name]}


def job(read: Callable[[Any], Any] = config_of) -> tuple[Any, random.Random]:
    """Return the configuration, built by ``read`` from its fields, and the random generator of the test."""
    fields = json.loads(os.environ[JOB])
    return read(fields["config"]), random.Random(fields["seed"])


def begin(dut: Any) -> tuple[Any, random.Random, Block, Checker]:
    """Return configuration, random generator, block and checker of a test."""
    config, rng = job()
    block = Block(dut)
    return config, rng, block, Checker(block)


def report(counts: Counter[str]) -> None:
    """Write the check counts for pytest."""
    Path("counts.json").write_text(json.dumps(counts))


class Step(NamedTuple):
    """A clock of a block: inputs, expected outputs, and a state to print if an output differs."""

    inputs: Mapping[str, int]
    outputs: Mapping[str, int]
    state: str = ""
    edge: bool = True  # False: no clock edge follows, for a pulse of an asynchronous reset


STEPS = "steps.pickle"
"""File with the steps that ``follow`` plays."""


@cocotb.test()
async def follow(dut: Any) -> None:
    """Play the steps of a file after a reset, and compare all outputs with the expected ones."""
    steps = pickle.loads(Path(STEPS).read_bytes())
    block = Block(dut)
    check = Checker(block)
    block.drive(**Step(*steps[0]).inputs)
    await block.reset()
    for step in map(Step._make, steps):
        block.drive(**step.inputs)
        await block.settle()
        check.outputs(step.state, **step.outputs)
        if step.edge:
            await block.edge()
