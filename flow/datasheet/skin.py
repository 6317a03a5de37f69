"""Datasheets of a skin of tiles and of its merge, from the golden models."""

import numpy as np

from eskin.flow.datasheet.sheet import Picture, Sheet, Wave
from eskin.flow.datasheet.waves import latencies
from eskin.model.tiles import merge
from eskin.model.tiles.config import MergeConfig, TilesConfig
from eskin.rtl.delivery import ports

TILES = 3
"""Largest number of tiles that offer events in the picture."""
EVENTS = 2
"""Events that each of these tiles sends."""
CLOCKS = 14
STALL = range(4, 6)
"""Clocks in which the sink takes nothing."""
MERGE_CLOCKS, HELD = 1, 2
"""Clocks from the offer of a tile to the output, and events that the merge can hold (docs/reference/tiles.md)."""


def waves(skin: TilesConfig) -> list[Wave]:
    """Return the waveforms of a merge whose first tiles each offer several events."""
    count = min(TILES, skin.tiles)
    left, state = [EVENTS] * count, merge.new_state()
    rows = []
    for clock in range(CLOCKS):
        asking = sum(1 << tile for tile, number in enumerate(left) if number and clock)
        taken = merge.chosen(state, np.uint64(asking))
        offers = bool(state[merge.HELD])
        ready = int(clock not in STALL)
        rows.append((asking, taken, int(offers), ready, int(state[merge.OFFERED]) if offers else None))
        merge.advance(state, taken, max(taken, 0), bool(ready))
        if taken >= 0:
            left[taken] -= 1
    asked, chosen, valid, readies, tiles = zip(*rows, strict=True)
    found = [Wave("tile_valid", asked, bus=True)]
    found.append(Wave("tile_ready", tuple(1 << tile if tile >= 0 else 0 for tile in chosen), bus=True))
    found += [Wave("event_valid", valid), Wave("event_ready", readies)]
    return [*found, *([Wave("event_tile", tiles, bus=True)] if skin.tile_bits else [])]


def sheet_of(config: MergeConfig | TilesConfig) -> Sheet:
    """Return the datasheet of a skin, or of its merge alone."""
    alone = isinstance(config, MergeConfig)
    skin = config.skin if isinstance(config, MergeConfig) else config
    tile = skin.tile
    values = {
        "skin": skin,
        "alone": alone,
        "tiles": TILES,
        "events": EVENTS,
        "stall": STALL,
        "bound": skin.tiles + HELD,
        "latencies": _times(skin, alone),
    }
    what = f"{skin.tile_rows} x {skin.tile_columns} tiles of {tile.rows} x {tile.columns} taxels"
    what += f", {skin.relays} relay stations on each line" if skin.relays else ""
    what += "" if alone else f", {skin.encoding}, {skin.resolution} b, {skin.frontend} front end"
    return Sheet(config, what, "skin.md", values, (Picture("merge", "Events of several tiles", waves(skin)),))


def _times(skin: TilesConfig, alone: bool) -> list[tuple[str, int]]:
    """Return the latencies in clocks."""
    bound, through = skin.tiles + HELD, skin.relays + MERGE_CLOCKS
    begins = "arrival at the merge" if skin.relays else "the offer of a tile"
    rows = [
        ("offer of a tile to `event_valid`, no other event in the skin", through),
        ("from one event to the next", 1),
    ]
    rows.append((f"longest time from {begins} to the event at the output, sink always ready", bound))
    if not alone and "sample_valid" in {port["name"] for port in ports(skin.tile)}:
        rows.insert(0, ("sample tick to `event_valid`, array idle", latencies(skin.tile).latency + through))
    return rows
