"""Compare the relay station's RTL with a queue in every clock, with its contract, and with the golden model."""

from __future__ import annotations

import json
import random
from collections import Counter, deque
from pathlib import Path
from typing import Any

import cocotb
import numpy as np

from eskin.cocotb_tests.bench.block import Block, Checker, Simulator, Sink, job, report
from eskin.cocotb_tests.runner.block import cosimulate
from eskin.model.tiles.config import TilesConfig

FIELDS = ("row", "col", "polarity")


class RelayBench:
    """A relay station with a queue as reference, and a log for the golden model.

    Attributes
    ----------
    queue : deque
        Events in the station, at most two.
    offer : tuple of int or None
        The event that the tile offers.
    offered, given, taken, left, ready : list
        First clock and event of every offer; the clock of every event taken; clock and payload of every event sent;
        the ready of the other end in every clock.
    """

    def __init__(self, dut: Any, config: TilesConfig, rng: random.Random) -> None:
        self.rng = rng
        self.block = Block(dut)
        self.check = Checker(self.block)
        tile = config.tile
        self.widths = (tile.row_bits, tile.column_bits, int(tile.has_polarity))
        self.is_async = config.reset == "async"
        self.block.drive(tile_valid=0, event_ready=0)
        self.clear()

    def clear(self) -> None:
        """Clear the log for a new run."""
        self.queue: deque[tuple[int, ...]] = deque()
        self.offer: tuple[int, ...] | None = None
        self.offered: list[int] = []
        self.given: list[tuple[int, ...]] = []
        self.taken: list[int] = []
        self.left: list[tuple[int, tuple[int, ...]]] = []
        self.ready: list[int] = []

    def _word(self) -> tuple[int, ...]:
        return tuple(self.rng.getrandbits(bits) if bits else 0 for bits in self.widths)

    def _seen(self) -> tuple[int, int, tuple[int, ...]]:
        read = self.block.read
        return read("tile_ready"), read("event_valid"), tuple(read(f"event_{name}") for name in FIELDS)

    async def clock(self, demand: float, ready: bool) -> None:
        """Offer an event, compare every output with the queue, and generate a clock edge."""
        if self.offer is None and self.rng.random() < demand:
            self.offer = self._word()
            self.offered.append(len(self.ready))
            self.given.append(self.offer)
        found = []
        for valid, takes in ((0, 0), (1, 1), (int(self.offer is not None), int(ready))):
            words = self.offer if self.offer is not None and valid else self._word()
            payload = {f"tile_{name}": value for name, value in zip(FIELDS, words, strict=True)}
            self.block.drive(tile_valid=valid, event_ready=takes, **payload)
            await self.block.settle()
            found.append(self._seen())
        self.check.holds("NoPath", found[0] == found[1] == found[2], found)  # outputs look at no input

        has_room, valid, event = found[2]
        self.check.equal("tile_ready", len(self.queue) < 2, has_room, self.queue)
        self.check.equal("event_valid", bool(self.queue), valid, self.queue)
        if self.queue:
            self.check.holds("Event", self.queue[0] == event, f"{event}; {self.queue}")
            if ready:
                self.left.append((len(self.ready), self.queue.popleft()))
                self.check.counts["transfers"] += 1
        if self.offer is not None and has_room:
            self.taken.append(len(self.ready))
            self.queue.append(self.offer)
            self.offer = None
        self.ready.append(int(ready))
        await self.block.edge()

    async def reset(self) -> None:
        """Reset the relay station during activity, which drops all its events."""
        self.clear()
        self.block.drive(rst=1)
        await self.block.settle()
        if self.is_async:
            self.check.equal("event_valid", 0, self.block.read("event_valid"), "rst is high")
        await self.block.reset()
        self.check.counts["resets"] += 1


@cocotb.test()
async def relay_keeps_its_contract(dut: Any) -> None:
    """Play busy and quiet tiles against all kinds of sinks."""
    config, rng = job()
    assert isinstance(config, TilesConfig)
    bench = RelayBench(dut, config, rng)
    await bench.block.reset()
    for _ in range(21):
        await bench.clock(1.0, ready=True)
    clocks = [clock for clock, _ in bench.left]
    bench.check.holds("FullRate", clocks == list(range(1, 21)), clocks)  # one event in every clock
    await bench.reset()
    for _ in range(4):  # until both places are full
        await bench.clock(1.0, ready=False)
    await bench.reset()
    sinks = sorted(Sink.NAMES, key=lambda name: name == "random")
    for name in sinks:
        sink = Sink(name, rng)
        for demand in (1.0, 0.5, 0.1):
            for _ in range(60):
                await bench.clock(demand, sink.ready())
        if name != sinks[-1]:
            await bench.reset()
    for _ in range(4):
        await bench.clock(0.0, ready=True)
    bench.check.holds("NoLoss", bench.given == [event for _, event in bench.left], "")
    trace = {name: getattr(bench, name) for name in ("offered", "taken", "ready")}
    Path("trace.json").write_text(json.dumps(trace | {"left": [clock for clock, _ in bench.left]}))
    report(bench.check.counts)


def play(config: TilesConfig, simulator: Simulator, folder: Path, seed: int) -> Counter[str]:
    """Run the relay station test, compare its last run with the golden model, and return the counts."""
    from eskin.model.tiles.relay import relay

    counts = cosimulate(config, simulator, "eskin_relay", "relay_keeps_its_contract", folder, seed, __name__)
    trace = json.loads((folder / "trace.json").read_text())
    ready = np.array(trace["ready"], np.uint8)
    found = relay(np.array(trace["offered"]), ready, len(ready))
    assert found.taken.tolist() == trace["taken"]
    assert found.clock.tolist() == trace["left"]
    counts["left in the last run"] = len(found.clock)
    return counts
