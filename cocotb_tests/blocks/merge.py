"""Compare the merge's RTL with a queue in every clock, with its contract, and with the golden model."""

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
    """A merge with tiles, sink and reference model, and a log for the golden model.

    Attributes
    ----------
    offers : list
        Event offered by each tile, or None.
    first_offered, given : list of lists
        Events of each tile, with the clocks in which they were first offered.
    ready, left : list
        The sink's ready in every clock; clock, tile and payload of every event that left.
    """

    def __init__(self, dut: Any, config: TilesConfig, rng: random.Random) -> None:
        self.config, self.rng = config, rng
        self.block = Block(dut)
        self.check = Checker(self.block)
        self.reference = MergeReference(config.tiles)
        self.block.drive(tile_valid=0, event_ready=0)
        self.clear()

    def clear(self) -> None:
        """Clear the log for a new run."""
        tiles = self.config.tiles
        self.offers: list[Payload | None] = [None] * tiles
        self.first_offered: list[list[int]] = [[] for _ in range(tiles)]
        self.given: list[list[Payload]] = [[] for _ in range(tiles)]
        self.ready: list[int] = []
        self.left: list[tuple[int, int, Payload]] = []
        self.reference.reset()

    def offer(self, demand: float, members: list[int]) -> None:
        """Let idle tiles offer a new event with a given probability."""
        tile_config = self.config.tile
        for tile in members:
            if self.offers[tile] is None and self.rng.random() < demand:
                row, column = (self.rng.randrange(n) for n in (tile_config.rows, tile_config.columns))
                event = (row, column, int(tile_config.has_polarity and self.rng.random() < 0.5))
                self.offers[tile] = event
                self.first_offered[tile].append(len(self.ready))
                self.given[tile].append(event)

    def drive_tiles(self) -> None:
        """Drive the offers onto the pins; unused pins are random."""
        tile = self.config.tile
        words = {"tile_valid": 0, "tile_row": 0, "tile_col": 0, "tile_polarity": 0}
        for index, event in enumerate(self.offers):
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
        self.drive_tiles()
        found = []
        for value in (not ready, ready):
            self.block.drive(event_ready=value)
            await self.block.settle()
            found.append(self.seen())
        self.check.holds("NoPathFromReady", found[0] == found[1], found)

        tile_ready, valid, tile, event = found[1]
        taken = self.reference.taken(self.offers)
        state = f"queue {list(self.reference.queue)}, offers {self.offers}"
        self.check.equal("tile_ready", 0 if taken is None else 1 << taken, tile_ready, state)
        self.check.equal("event_valid", bool(self.reference.queue), valid, state)
        if self.reference.queue:
            self.check.holds("Event", self.reference.queue[0] == (tile, event), f"{tile}, {event}; {state}")
            if ready:
                self.left.append((len(self.ready), tile, event))
                self.check.counts["transfers"] += 1
        self.ready.append(int(ready))
        await self.block.edge()
        self.reference.clock(self.offers, ready)
        if taken is not None:
            self.offers[taken] = None

    async def reset(self) -> None:
        """Reset the merge during activity, which drops all its events."""
        self.clear()
        self.drive_tiles()
        self.block.drive(rst=1)
        await self.block.settle()
        if self.config.reset == "async":
            self.check.equal("event_valid", 0, self.block.read("event_valid"), "rst is high")
        await self.block.reset()
        self.check.counts["resets"] += 1


@cocotb.test()
async def merge_keeps_its_contract(dut: Any) -> None:
    """Play busy and quiet tiles against all kinds of sinks."""
    config, rng = job()
    assert isinstance(config, TilesConfig)
    bench = MergeBench(dut, config, rng)
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
    for _ in range(4):  # until both places are full
        await bench.clock(1.0, everyone, ready=False)
    await bench.reset()
    sinks = sorted(Sink.NAMES, key=lambda name: name == "random")
    for sink_name in sinks:
        sink = Sink(sink_name, rng)
        for demand in (1.0, 0.5, 1.0 / config.tiles, 0.02):
            for _ in range(40):
                await bench.clock(demand, everyone, sink.ready())
        if sink_name != sinks[-1]:
            await bench.reset()
    for _ in range(config.tiles + 3):
        await bench.clock(0.0, everyone, ready=True)
    given = [(tile, event) for tile, events in enumerate(bench.given) for event in events]
    bench.check.holds("NoLoss", sorted(given) == sorted((tile, event) for _, tile, event in bench.left), "")
    trace = {name: getattr(bench, name) for name in ("first_offered", "given", "ready", "left")}
    Path("trace.json").write_text(json.dumps(trace))
    report(bench.check.counts)


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
