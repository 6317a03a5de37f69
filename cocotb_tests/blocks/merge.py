"""Compare the merge's RTL with a queue in every clock, with its contract, and with the golden model."""

from __future__ import annotations

import json
import random
from collections import Counter, deque
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cocotb
import numpy as np

from eskin.cocotb_tests.bench.block import Block, Checker, Simulator, Sink, job, report
from eskin.cocotb_tests.runner.block import cosimulate
from eskin.model.tiles.config import TilesConfig

Payload = tuple[int, int, int]
"""Row, column and polarity of an event, 0 for a field that the configuration does not have."""


class MergeReference:
    """Reference model of the merge: a queue of two events, filled by the tiles in turn."""

    def __init__(self, tiles: int) -> None:
        self.tiles = tiles
        self.reset()

    def reset(self) -> None:
        """Reset the queue and the tile order."""
        self.queue: deque[tuple[int, Payload]] = deque()
        self.last = self.tiles - 1

    def taken(self, offers: list[Payload | None]) -> int | None:
        """Return the tile whose event is taken in this clock."""
        turns = [(self.last + step) % self.tiles for step in range(1, self.tiles + 1)]
        asking = [tile for tile in turns if offers[tile] is not None]
        return asking[0] if asking and len(self.queue) < 2 else None

    def clock(self, offers: list[Payload | None], ready: bool) -> None:
        """Apply a rising edge."""
        tile = self.taken(offers)
        if ready and self.queue:
            self.queue.popleft()
        if tile is not None:
            payload = offers[tile]
            assert payload is not None
            self.queue.append((tile, payload))
            self.last = tile


class MergeBench:
    """A merge with tiles, sink and reference model, and a log for the golden model."""

    def __init__(self, dut: Any, config: TilesConfig, rng: random.Random, tiles: int) -> None:
        self.config, self.rng, self.tiles = config, rng, tiles
        self.block = Block(dut)
        self.check = Checker(self.block)
        self.reference = MergeReference(tiles)
        self.block.drive(tile_valid=0, event_ready=0)
        self.clear()

    def clear(self) -> None:
        """Clear the log for a new run."""
        self.offers: list[Payload | None] = [None] * self.tiles
        self.first_offered: list[list[int]] = [[] for _ in range(self.tiles)]  # clocks of the events given
        self.given: list[list[Payload]] = [[] for _ in range(self.tiles)]
        self.taken: list[int] = []  # clocks
        self.ready: list[int] = []  # in every clock
        self.left: list[tuple[int, int, Payload]] = []  # clock, tile and payload
        self.reference.reset()

    def event(self) -> Payload:
        """Return a random event of a tile."""
        tile = self.config.tile
        row, column = (self.rng.randrange(n) for n in (tile.rows, tile.columns))
        return row, column, int(tile.has_polarity and self.rng.random() < 0.5)

    def probes(self, ready: bool) -> list[tuple[list[Payload | None], bool]]:
        """Return pairs of offers and ready that must give equal outputs; the last pair stays until the clock edge."""
        return [(self.offers, not ready), (self.offers, ready)]

    def tile_ready(self, taken: int | None) -> int:
        """Return the expected tile_ready if the event of a tile is taken."""
        return 0 if taken is None else 1 << taken

    def offer(self, demand: float, members: list[int]) -> None:
        """Let idle tiles offer a new event with a given probability."""
        for tile in members:
            if self.offers[tile] is None and self.rng.random() < demand:
                self.offers[tile] = event = self.event()
                self.first_offered[tile].append(len(self.ready))
                self.given[tile].append(event)

    def drive_tiles(self, offers: list[Payload | None]) -> None:
        """Drive offers onto the pins; unused pins are random."""
        tile = self.config.tile
        words = {"tile_valid": 0, "tile_row": 0, "tile_col": 0, "tile_polarity": 0}
        for index, event in enumerate(offers):
            noise = tuple(self.rng.getrandbits(bits) if bits else 0 for bits in (tile.row_bits, tile.column_bits, 1))
            row, column, polarity = event or noise
            words["tile_valid"] |= (event is not None) << index
            words["tile_row"] |= row << index * tile.row_bits
            words["tile_col"] |= column << index * tile.column_bits
            words["tile_polarity"] |= polarity << index
        self.block.drive(**words)

    def seen(self) -> tuple[int, int, int, Payload]:
        """Return the outputs: tile_ready, event_valid, event_tile and the payload."""
        read = self.block.read
        fields = (read("event_row"), read("event_col"), read("event_polarity"))
        return read("tile_ready"), read("event_valid"), read("event_tile"), fields

    async def clock(self, demand: float, members: list[int], ready: bool) -> None:
        """Offer events, compare all outputs with the reference, and generate a clock edge."""
        self.offer(demand, members)
        found = []
        for offers, value in self.probes(ready):
            self.drive_tiles(offers)
            self.block.drive(event_ready=value)
            await self.block.settle()
            found.append(self.seen())
        self.check.holds("NoPath", all(outputs == found[0] for outputs in found), found)

        tile_ready, valid, tile, event = found[-1]
        taken = self.reference.taken(self.offers)
        state = f"queue {list(self.reference.queue)}, offers {self.offers}"
        self.check.equal("tile_ready", self.tile_ready(taken), tile_ready, state)
        self.check.equal("event_valid", bool(self.reference.queue), valid, state)
        if self.reference.queue:
            self.check.holds("Event", self.reference.queue[0] == (tile, event), f"{tile}, {event}; {state}")
            if ready:
                self.left.append((len(self.ready), tile, event))
                self.check.counts["transfers"] += 1
        if taken is not None:
            self.taken.append(len(self.ready))
        self.ready.append(int(ready))
        await self.block.edge()
        self.reference.clock(self.offers, ready)
        if taken is not None:
            self.offers[taken] = None

    async def reset(self) -> None:
        """Reset the block during activity, which drops all its events."""
        self.clear()
        self.drive_tiles(self.offers)
        self.block.drive(rst=1)
        await self.block.settle()
        if self.config.reset == "async":
            self.check.equal("event_valid", 0, self.block.read("event_valid"), "rst is high")
        await self.block.reset()
        self.check.counts["resets"] += 1

    async def finish(self, demands: Iterable[float], clocks: int) -> None:
        """Play busy and quiet tiles against all kinds of sinks; check that nothing is lost, and report."""
        everyone = list(range(self.tiles))
        for _ in range(4):  # until both places are full
            await self.clock(1.0, everyone, ready=False)
        await self.reset()
        sinks = sorted(Sink.NAMES, key=lambda name: name == "random")
        for name in sinks:
            sink = Sink(name, self.rng)
            for demand in demands:
                for _ in range(clocks):
                    await self.clock(demand, everyone, sink.ready())
            if name != sinks[-1]:
                await self.reset()
        for _ in range(self.tiles + 3):
            await self.clock(0.0, everyone, ready=True)
        given = [(tile, event) for tile, events in enumerate(self.given) for event in events]
        self.check.holds("NoLoss", sorted(given) == sorted((tile, event) for _, tile, event in self.left), "")
        trace = {name: getattr(self, name) for name in ("first_offered", "given", "taken", "ready", "left")}
        Path("trace.json").write_text(json.dumps(trace))
        report(self.check.counts)


@cocotb.test()
async def merge_keeps_its_contract(dut: Any) -> None:
    """Play busy and quiet tiles against all kinds of sinks."""
    config, rng = job()
    assert isinstance(config, TilesConfig)
    bench = MergeBench(dut, config, rng, config.tiles)
    everyone = list(range(config.tiles))
    some = sorted(rng.sample(everyone, (config.tiles + 1) // 2))
    await bench.block.reset()
    for members in (everyone, some, everyone[:1]):
        rounds = 6
        for _ in range(rounds * len(members) + 1):
            await bench.clock(1.0, members, ready=True)
        shares = [sum(tile == member for _, tile, _ in bench.left) for member in members]
        bench.check.holds("Fairness", shares == [rounds] * len(members), shares)  # and an event in every clock
        await bench.reset()
    await bench.finish((1.0, 0.5, 1.0 / config.tiles, 0.02), 40)


def play(config: TilesConfig, simulator: Simulator, folder: Path, seed: int) -> Counter[str]:
    """Run the merge test of a skin, compare its last run with the golden model, and return the counts."""
    from eskin.model.tiles.merge import merge

    counts = cosimulate(config, simulator, "eskin_merge", "merge_keeps_its_contract", folder, seed, __name__)
    trace = json.loads((folder / "trace.json").read_text())
    ready = np.array(trace["ready"], np.uint8)
    clock, tile, number = merge([np.array(clocks) for clocks in trace["first_offered"]], ready, len(ready))
    left = [
        [t, i, trace["given"][i][k]] for t, i, k in zip(clock.tolist(), tile.tolist(), number.tolist(), strict=True)
    ]
    assert left == trace["left"]
    counts["left in the last run"] = len(left)
    return counts
