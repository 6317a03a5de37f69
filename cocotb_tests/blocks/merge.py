"""Steps of the merge and of a relay station, compared with the independent model."""

import functools
import itertools
import random
from collections import Counter
from collections.abc import Iterator
from typing import Any

from eskin.cocotb_tests.bench.block import Sink, Step, bits, payload
from eskin.cocotb_tests.independent.arbiter import Event
from eskin.cocotb_tests.independent.merge import Merge
from eskin.model.tiles.config import TilesConfig

CLOCKS = 120


def steps(config: TilesConfig, rng: random.Random, counts: Counter[str], relay: bool = False) -> Iterator[Step]:
    """Yield busy and quiet tiles against all kinds of sinks, with resets.

    A relay station is a merge of one tile, except that its ready does not depend on the tile.
    """
    tiles, tile = (1 if relay else config.tiles), config.tile
    sizes = {"tile_row": tile.row_bits, "tile_col": tile.column_bits, "tile_polarity": int(tile.has_polarity)}
    merge = Merge(tiles)
    everyone = list(range(tiles))
    groups = (everyone, sorted(rng.sample(everyone, (tiles + 1) // 2)), everyone[:1])
    phases = itertools.product(groups, (1.0, 0.5, 1.0 / tiles, 0.02))
    for (group, demand), sink_name in zip(phases, itertools.cycle((*Sink.NAMES, "always")), strict=False):
        sink = Sink(sink_name, rng)
        offers: list[Event | None] = [None] * tiles
        for clock in range(CLOCKS):
            rst, ready = clock == CLOCKS - 1, sink.ready()
            words = dict.fromkeys(sizes, 0)
            for number in everyone:
                event: Any = tuple(rng.getrandbits(size) if size else 0 for size in sizes.values())
                if offers[number] is None and number in group and rng.random() < demand:
                    offers[number] = event
                for (name, size), value in zip(sizes.items(), offers[number] or event, strict=True):
                    words[name] |= value << number * size  # of a quiet tile at random
            valid = bits([offer is not None for offer in offers])
            if rst and config.reset == "async":
                merge.reset()
            taken, offered = merge.taken(offers), merge.output()
            tile_ready = len(merge.queue) < 2 if relay else 0 if taken is None else 1 << taken
            outputs = {"tile_ready": tile_ready, "event_valid": offered is not None}
            if offered is not None:
                outputs |= payload(tile, *offered[1]) | ({"event_tile": offered[0]} if tiles > 1 else {})
            inputs = {"rst": rst, "event_ready": ready, "tile_valid": valid, **words}
            yield Step(inputs, outputs, f"queue {merge.queue}, offers {offers}")
            counts["transfers"] += offered is not None and ready
            counts["withheld"] += offered is not None and not ready
            counts["resets"] += rst
            merge.clock(offers, ready)
            if taken is not None:
                offers[taken] = None
            if rst:
                merge.reset()


relay_steps = functools.partial(steps, relay=True)
