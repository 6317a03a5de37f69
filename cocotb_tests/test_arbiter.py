"""Compare the arbiter's RTL with the reference arbiter in every clock, and check that it loses nothing and is fair.

The proofs of ``eskin.verify.proofs.blocks.arbiter`` have its whole contract.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cocotb
import pytest

from eskin.cocotb_tests.bench.block import Block, Checker, Sink, bits, job, payload, report
from eskin.cocotb_tests.bench.reference import ArbiterReference
from eskin.cocotb_tests.runner.block import cosimulate
from eskin.model.config import ReadoutConfig

Want = Callable[[int, int], bool]
"""Function of row and column: whether the taxel requests in this clock, if it has no pending request."""


class RowsAgent:
    """Model of the taxel rows: drives request lines, and column lines of selected rows.

    ``requests`` has the polarity of every pending request, None where there is none.
    """

    def __init__(self, config: ReadoutConfig, rng: random.Random) -> None:
        self.config, self.rng = config, rng
        self.requests: list[list[bool | None]] = []
        self.clear()

    def clear(self) -> None:
        """Clear all requests, as a reset does."""
        self.requests = [[None] * self.config.columns for _ in range(self.config.rows)]

    def raise_requests(self, want: Want) -> None:
        """Raise the wanted requests that are not yet pending."""
        for row, line in enumerate(self.requests):
            for column, pending in enumerate(line):
                if pending is None and want(row, column):
                    line[column] = self.rng.random() < 0.5 or not self.config.has_polarity

    def withdraw(self, share: float) -> None:
        """Withdraw a fraction of the requests, as a mask does."""
        for line in self.requests:
            for column, pending in enumerate(line):
                if pending is not None and self.rng.random() < share:
                    line[column] = None

    def row_lines(self) -> int:
        """Return the level of row_request."""
        return bits([any(polarity is not None for polarity in line) for line in self.requests])

    def column_lines(self, select: int) -> tuple[int, int]:
        """Return column_request and column_polarity of the selected rows."""
        request = polarity = 0
        for row, line in enumerate(self.requests):
            if select >> row & 1:
                shift = row * self.config.columns
                request |= bits([value is not None for value in line]) << shift
                noise = [self.rng.random() < 0.5 if value is None else value for value in line]
                polarity |= bits(noise) << shift
        return request, polarity


class ArbiterBench:
    """An arbiter with rows and sink, compared with the reference arbiter in every clock.

    Assumptions on the environment: a request stays until its row is granted or it is withdrawn, and a selected row
    drives the column lines in the same clock.
    """

    def __init__(self, dut: Any, config: ReadoutConfig, rng: random.Random) -> None:
        self.config, self.rng = config, rng
        self.block = Block(dut)
        self.check = Checker(self.block)
        self.rows = RowsAgent(config, rng)
        self.reference = ArbiterReference(config)
        self.served: Counter[tuple[int, int]] = Counter()
        self.block.drive(row_request=0, column_request=0, column_polarity=0, event_ready=0)

    def fields(self) -> tuple[int, ...]:
        """Return the payload at the ports."""
        return tuple(self.block.read(name) for name in payload(self.config, 0, 0, False))

    async def ready_changes_nothing(self) -> None:
        """Check NoCombinationalReadyToValid: outputs do not depend on event_ready."""
        seen = []
        for ready in (0, 1, 0):
            self.block.drive(event_ready=ready)
            await self.block.settle()
            seen.append((self.block.read("event_valid"), self.block.read("select"), *self.fields()))
        self.check.holds("NoCombinationalReadyToValid", seen[0] == seen[1] == seen[2], seen)

    async def clock(self, want: Want, ready: bool, withdraw: float = 0.0) -> None:
        """Raise requests, check all outputs, and generate a clock edge."""
        block = self.block
        self.rows.withdraw(withdraw)
        self.rows.raise_requests(want)
        row_request = self.rows.row_lines()
        block.drive(row_request=row_request, event_ready=ready)
        await block.settle()
        request, polarity = self.rows.column_lines(block.read("select"))
        block.drive(column_request=request, column_polarity=polarity)
        await self.ready_changes_nothing()
        block.drive(event_ready=ready)
        await block.settle()

        self.compare(ready)
        granted = block.read("granted")
        if ready and (event := self.reference.event):
            self.served[event.row, event.column] += 1
            self.check.counts["transfers"] += 1

        await block.edge()
        self.reference.clock(self.rows.requests, ready)
        for row in range(self.config.rows):
            if granted >> row & 1:
                self.rows.requests[row] = [None] * self.config.columns

    def compare(self, ready: bool) -> None:
        """Compare all outputs with the reference."""
        requests, reference, read = self.rows.requests, self.reference, self.block.read
        state = f"last {reference.last}, latch {reference.latch}, ready {ready}, requests {self.block.dut.row_request}"
        for name, row in (("select", reference.selected(requests)), ("granted", reference.granted(requests, ready))):
            self.check.equal(name, 0 if row is None else 1 << row, read(name), state)
        event = reference.event
        self.check.equal("event_valid", event is not None, read("event_valid"), state)
        if event is not None:
            for name, value in payload(self.config, *event).items():
                self.check.equal(name, value, read(name), state)

    async def drain(self, clocks: int) -> None:
        """Wait until all pending requests have been sent."""
        for _ in range(clocks):
            await self.clock(lambda row, column: False, ready=True)
        left = self.rows.row_lines() or self.reference.latch
        self.check.holds("NoLoss", not left, left)

    async def reset(self) -> None:
        """Reset the arbiter during activity."""
        self.rows.clear()
        self.reference.reset()
        self.block.drive(row_request=0, column_request=0, event_ready=0, rst=1)
        await self.block.settle()
        if self.config.reset == "async":  # in mid-clock: nothing is offered at once
            self.check.equal("event_valid", 0, self.block.read("event_valid"), "rst is high")
        await self.block.reset()
        self.check.counts["resets"] += 1


@cocotb.test()
async def arbiter_keeps_its_contract(dut: Any) -> None:
    """Play all kinds of demand against all kinds of sinks, and end each run by draining or a reset."""
    config, rng = job()
    bench = ArbiterBench(dut, config, rng)
    await bench.block.reset()
    everyone = [(row, column) for row in range(config.rows) for column in range(config.columns)]
    full = config.taxels * 3 + 8
    one = rng.choice(everyone)
    some = sorted({rng.choice(everyone) for _ in range(5)})
    always: dict[str, list[tuple[int, int]]] = {
        "everyone": everyone,
        "one row": [taxel for taxel in everyone if taxel[0] == one[0]],
        "one column": [taxel for taxel in everyone if taxel[1] == one[1]],
        "one taxel": [one],
        "some": some,
    }
    for wanting in always.values():
        members = set(wanting)
        before = bench.check.counts["transfers"]
        clocks = len(wanting) * 3 + 8 if len(wanting) > 1 else 40
        for _ in range(clocks):
            await bench.clock(lambda row, column, members=members: (row, column) in members, ready=True)  # type: ignore[misc]
        shares = [bench.served[taxel] for taxel in wanting]
        bench.check.holds("Fairness", max(shares) - min(shares) <= 1 and min(shares) > 1, shares)
        bench.served.clear()
        bench.check.equal("events", clocks - 1, bench.check.counts["transfers"] - before)
        await (bench.reset() if len(wanting) % 2 else bench.drain(2 * config.taxels + 4))
        bench.served.clear()

    for sink_name in Sink.NAMES:
        for demand, withdraw in ((0.02, 0.0), (0.3, 0.0), (0.2, 0.1)):
            sink = Sink(sink_name, rng)
            for _ in range(120):
                await bench.clock(lambda row, column, p=demand: rng.random() < p, sink.ready(), withdraw)  # type: ignore[misc]
            if rng.random() < 0.5:
                await bench.reset()
        await bench.drain(full)
    report(bench.check.counts)


CONFIGS = [
    ReadoutConfig(rows=1, columns=1, encoding="nlcs"),
    ReadoutConfig(rows=1, columns=1, reset="async"),
    ReadoutConfig(rows=1, columns=4),
    ReadoutConfig(rows=5, columns=1, encoding="nlcs", reset="async"),
    ReadoutConfig(rows=3, columns=5, encoding="cw-lcs"),
    ReadoutConfig(rows=2, columns=64, reset="async"),
    ReadoutConfig(rows=64, columns=2, encoding="nlcs"),
]


def name(config: ReadoutConfig) -> str:
    """Return the name of a configuration in the list of tests."""
    return f"{config.rows}x{config.columns}-{'bipolar' if config.has_polarity else 'unipolar'}-{config.reset}"


@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: f"icarus-{name(config)}")
def test_arbiter_keeps_its_contract_and_equals_its_reference(config: ReadoutConfig, tmp_path: Path) -> None:
    counts = cosimulate(config, "icarus", "eskin_arbiter", "arbiter_keeps_its_contract", tmp_path, seed=2)
    assert counts["transfers"] > 200
    assert counts["resets"] > 0
    assert counts["checks"] > 3 * counts["transfers"]
    assert all(counts[name] > 0 for name in ("NoCombinationalReadyToValid", "NoLoss", "Fairness")), counts
