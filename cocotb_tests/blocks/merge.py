"""Compare the RTL of the merge and of a relay station with the independent model in every clock."""

from __future__ import annotations

import itertools
from typing import Any

import cocotb

from eskin.cocotb_tests.bench.block import Sink, begin, payload, report
from eskin.cocotb_tests.independent.arbiter import Event
from eskin.cocotb_tests.independent.merge import Merge

CLOCKS = 120


@cocotb.test()
async def merge_follows_its_reference(dut: Any) -> None:
    """Play busy and quiet tiles against all kinds of sinks, with resets.

    A relay station is a merge of one tile, except that its ready does not depend on the tile.
    """
    config, rng, block, check = begin(dut)
    relay = dut._name == "eskin_relay"
    tiles, tile = (1 if relay else config.tiles), config.tile
    sizes = (tile.row_bits, tile.column_bits, tile.has_polarity)
    names = ("tile_row", "tile_col", "tile_polarity")
    merge = Merge(tiles)
    block.drive(tile_valid=0, event_ready=0)
    await block.reset()
    everyone = list(range(tiles))
    groups = (everyone, sorted(rng.sample(everyone, (tiles + 1) // 2)), everyone[:1])
    phases = itertools.product(groups, (1.0, 0.5, 1.0 / tiles, 0.02))
    for (group, demand), sink_name in zip(phases, itertools.cycle((*Sink.NAMES, "always")), strict=False):
        sink = Sink(sink_name, rng)
        offers: list[Event | None] = [None] * tiles
        for clock in range(CLOCKS):
            rst, ready = clock == CLOCKS - 1, sink.ready()
            words = dict.fromkeys(names, 0)
            for number in everyone:
                event: Any = tuple(rng.getrandbits(size) if size else 0 for size in sizes)
                if offers[number] is None and number in group and rng.random() < demand:
                    offers[number] = event
                for name, size, value in zip(names, sizes, offers[number] or event, strict=True):
                    words[name] |= value << number * size  # of a quiet tile at random
            valid = sum(1 << number for number in everyone if offers[number] is not None)
            block.drive(rst=rst, event_ready=ready, tile_valid=valid, **words)
            await block.settle()
            if rst and config.reset == "async":
                merge.reset()
            taken, offered = merge.taken(offers), merge.output()
            state = {**vars(merge), "offers": offers, "ready": ready}
            tile_ready = len(merge.queue) < 2 if relay else 0 if taken is None else 1 << taken
            check.outputs(state, tile_ready=tile_ready, event_valid=offered is not None)
            if offered is not None:
                sender = {"event_tile": offered[0]} if not relay and tiles > 1 else {}
                check.outputs(state, **sender, **payload(tile, *offered[1]))
            check.counts["transfers"] += offered is not None and ready
            check.counts["withheld"] += offered is not None and not ready
            await block.edge()
            merge.clock(offers, ready)
            if taken is not None:
                offers[taken] = None
            if rst:
                merge.reset()
                check.counts["resets"] += 1
    report(check.counts)
