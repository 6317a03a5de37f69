"""Datasheets of a skin of tiles and of its merge, from the golden models."""

from __future__ import annotations

import numpy as np

from eskin.flow.datasheet.latencies import Latencies
from eskin.flow.datasheet.sheet import NO_NETLIST, RESETS, Picture, Sheet, shown, si, time_table
from eskin.flow.datasheet.waves import Wave
from eskin.model.tiles import merge
from eskin.model.tiles.config import MergeConfig, TilesConfig
from eskin.rtl.delivery import ports

TILES = 3
"""Tiles that offer events in the picture, or as many as there are."""
EVENTS = 2
"""Events of each of them."""
CLOCKS = 14
STALL = range(4, 6)
"""Clocks in which the sink takes nothing."""
MERGE_CLOCKS, HELD = 1, 2
"""Clocks from a tile's offer to the output, and the events that the merge holds (docs/reference/tiles.md)."""


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
    picture = Picture("merge", "Events of several tiles", waves(skin))
    sections = {
        "Clock": [
            f"One clock for all tiles, rising edge: {si(skin.clock_hz, 'Hz')}, a period T of "
            f"{si(1 / skin.clock_hz, 's')}."
        ],
        "Reset": [
            f"{RESETS[skin.reset]} Every flop has it, none relies on an initial value. After it tile 0 comes first."
        ],
        "Latency and throughput": _times(skin, alone),
        "Timing": [
            shown("eskin_merge" if alone else "eskin_tiles", picture),
            "",
            f"{'' if alone else 'Within, at the merge. '}{min(TILES, skin.tiles)} of the tiles offer {EVENTS} events "
            f"each; the sink takes nothing in the clocks {STALL[0]} and {STALL[-1]}. Bit i of a word is tile i.",
        ],
        "Registers": ["None: the configuration is built in."],
        "Area, power and highest clock": NO_NETLIST,
    }
    what = f"{skin.tile_rows} x {skin.tile_columns} tiles of {tile.rows} x {tile.columns} taxels"
    what += f", {skin.relays} relay stations on each line" if skin.relays else ""
    what += "" if alone else f", {skin.encoding}, {skin.resolution} b, {skin.frontend} front end"
    return Sheet(config, what, sections, (picture,))


def _times(skin: TilesConfig, alone: bool) -> list[str]:
    """Return the table of latencies."""
    bound, through = skin.tiles + HELD, skin.relays + MERGE_CLOCKS
    begins = "arrival at the merge" if skin.relays else "a tile's offer"
    rows = [("a tile's offer to `event_valid`, no other event on its way", through), ("from one event to the next", 1)]
    rows.append((f"{begins} to the event at the output, at most, the sink always ready", bound))
    if not alone and "sample_valid" in {port["name"] for port in ports(skin.tile)}:
        rows.insert(0, ("sample tick to `event_valid`, array idle", Latencies.of(skin.tile).latency + through))
    return [
        f"Throughput: {si(skin.clock_hz, 'events/s')}, one in every clock as long as any tile offers one. "
        f"An event that {'has reached the merge' if skin.relays else 'a tile offers'} is among the next {bound} that "
        "leave, whatever the sink does.",
        "",
        *time_table(rows, skin.clock_hz),
        "",
        f"The times of a tile itself are those of its readout: `make verilog ROWS={skin.tile.rows} "
        f"COLUMNS={skin.tile.columns}` writes its datasheet.",
    ]
