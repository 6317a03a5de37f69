"""Coverage points of the frame readout, the merge of tiles, and the relay stations."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from eskin.model.frame_config import FrameConfig
from eskin.model.frame_words import bit_positions
from eskin.model.tiles.config import TilesConfig
from eskin.verify.coverage.points.point import Named, Point, began, points_of


def frames(config: FrameConfig) -> Iterator[Point]:
    """Return the coverage points of a frame readout."""
    group = f"frames {config.rows} x {config.columns}, {config.resolution} in {config.word_bits} bits"
    return points_of(group, "eskin_frame_readout", _scans(config), _codes(config), _words(config))


def _scans(config: FrameConfig) -> Named:
    """Yield the points of the sequencer: frame requests and resets in each state."""
    ends = "sequencer.taken && sequencer.frame_ends"
    yield "frame begun at rest", "frame_start && !sequencer.scanning && !packer.awake && !word_valid"
    yield "frame begun while words of the one before wait", "frame_start && !sequencer.scanning && word_valid"
    yield "start missed", "frame_start && sequencer.scanning && !sequencer.taken"
    yield "start missed in the clock in which the frame ends", f"frame_start && {ends}"
    yield "start in the clock behind the end", f"frame_start && $past({ends})"
    yield "starts missed in two clocks running", "frame_overrun && $past(frame_overrun)"
    for row in range(config.rows):
        for column in range(config.columns):
            here = f"row_select == {1 << row} && column_select == {1 << column}"
            yield f"conversion of taxel {row}, {column}", f"adc_start && {here}"
    yield "reset within a conversion", began("sequencer.converting")
    yield "reset while a word waits", began("word_valid && !word_ready")
    yield "reset while a multiplexer settles", began("sequencer.scanning && sequencer.settling != 0")


def _codes(config: FrameConfig) -> Named:
    """Yield the points of the ADC: conversion times, and both ends of the scale."""
    bits = config.resolution
    yield "lowest code", f"sequencer.taken && adc_code == {bits}'d{1 << bits - 1}"
    yield "highest code", f"sequencer.taken && adc_code == {bits}'d{(1 << bits - 1) - 1}"
    yield "code in the clock behind the start", "sequencer.taken && $past(adc_start)"
    yield "code two N clocks behind the start", f"sequencer.taken && $past(adc_start, {2 * bits})"
    yield "done without a conversion", "adc_done && !sequencer.converting"
    yield "done still high at the next start", "adc_start && adc_done"
    waits = "sequencer.sample_valid && !sequencer.sample_ready"
    yield "code waits for the packer", waits
    begins = "sequencer.scanning && !sequencer.converting && sequencer.settling == 0"
    yield "conversion waits for the code before", f"{waits} && {begins}"


def _words(config: FrameConfig) -> Named:
    """Yield the points of the packer: bit positions, partial words, and stalls."""
    yield "word waits for the sink", "word_valid && !word_ready"
    yield "first word of a frame taken", "word_valid && word_ready && word_sync"
    yield "sink ready without a word", "!word_valid && word_ready"
    if config.word_bits == config.resolution:
        return
    # A code is put only where no word waits; so a word meets another if two steps that end one follow each other.
    ends = config.taxels * config.resolution % config.word_bits
    filled = [number * config.resolution // config.word_bits for number in range(config.taxels + 1)]
    steps = [after > before for before, after in itertools.pairwise(filled)] + [True] * bool(ends)
    if any(this and following for this, following in zip(steps, [*steps[1:], steps[0]], strict=True)):
        yield "word taken as the next is filled", "word_valid && word_ready && packer.emits"
    placed = "packer.sample_valid && packer.free && !packer.flush"
    taken = {number * config.resolution % config.word_bits for number in range(config.taxels)}
    grain = bit_positions(config)
    for place in sorted(taken):
        yield f"code put at bit {place}", f"{placed} && packer.fill == {place // grain}"
    if config.taxels * config.resolution > config.word_bits:
        rest = any(config.word_bits - place < config.resolution for place in taken)
        yield "word completed", f"{placed} && packer.complete{' && packer.remains != 0' * rest}"
    if ends:
        yield "last word filled up", "packer.flush && packer.free"
        if all(steps[-2:]):
            yield "last word waits for the one before", "packer.flush && !packer.free"


def merge(config: TilesConfig) -> Iterator[Point]:
    """Return the coverage points of a merge."""
    return points_of(f"merge of {config.tiles} tiles", "eskin_merge", _merge(config))


def _merge(config: TilesConfig) -> Named:
    tiles = config.tiles
    for tile in range(tiles):
        yield f"event of tile {tile} taken", f"tile_valid[{tile}] && tile_ready[{tile}]"
        yield f"tile {tile} alone offers", f"tile_valid == {1 << tile}"
    last = f"tile_valid[{tiles - 1}:1] & behind"
    yield "a later tile has its turn", f"comes && |({last})"
    yield "the turn wraps", f"comes && behind != 0 && !(|({last}))"
    yield "the same tile twice", f"comes && $past(comes) && chosen == $past(chosen) && $past({tiles} > 1)"
    yield "all tiles offer", "&tile_valid"
    yield "no tile offers", "!(|tile_valid) && !rst"
    yield "taken while empty", "comes && !event_valid"
    yield "taken as one leaves", "comes && event_valid && event_ready"
    yield "taken while the sink stalls", "comes && event_valid && !event_ready"
    yield "full, and tiles wait", "full && |tile_valid && !event_ready"
    yield "full, and one leaves", "full && event_valid && event_ready"
    yield "runs empty", "event_valid && event_ready && !full && !comes"
    yield "reset while full", began("full")
    yield "reset with one event held", began("event_valid && !full")
    if config.tile.has_polarity:
        yield "ON leaves", "event_valid && event_ready && event_polarity"
        yield "OFF leaves", "event_valid && event_ready && !event_polarity"


def lines(config: TilesConfig) -> Iterator[Point]:
    """Yield the coverage points of relay stations and lines."""
    kind = f"{config.tile.encoding}, reset {config.reset}"
    yield from points_of(f"relay station {kind}", "eskin_relay", _station(config))
    group = f"{config.relays} relay stations a line, {config.tiles} tiles {kind}"
    yield from points_of(group, "eskin_tiles", _stations(config))


def _station(config: TilesConfig) -> Named:
    """Yield the points of one relay station: full and empty entries, stalls, and resets in each state."""
    leaves = "event_valid && event_ready"
    yield "at rest", "!event_valid && !tile_valid && !rst"
    yield "ready without an event", "!event_valid && event_ready && !rst"
    yield "taken while empty", "comes && !event_valid"
    yield "taken as one leaves", f"comes && {leaves}"
    yield "taken in the clock of a stall", "comes && event_valid && !event_ready"
    yield "the line waits for a full station", "full && tile_valid"
    yield "full, and one leaves", f"full && {leaves}"
    yield "full for several clocks", "full && $past(full) && $past(full, 2)"
    yield "the second place moves up, and the line goes on", f"comes && $past(full && {leaves})"
    yield "runs empty", f"{leaves} && !full && !comes"
    yield "events in two clocks running", f"{leaves} && $past({leaves})"
    yield "reset while full", began("full")
    yield "reset with one event held", began("event_valid && !full")
    yield "reset while empty", began("!event_valid")
    for name, bits in (("row", config.tile.row_bits), ("col", config.tile.column_bits)):
        for end, value in (("first", 0), ("last", (1 << bits) - 1)):
            if bits:
                yield f"{end} {name} leaves", f"{leaves} && event_{name} == {value}"
    if config.tile.has_polarity:
        yield "ON leaves", f"{leaves} && event_polarity"
        yield "OFF leaves", f"{leaves} && !event_polarity"


def _stations(config: TilesConfig) -> Named:
    """Yield the points of all lines together: stalls, and tiles that overtake each other."""
    tiles, relays = range(config.tiles), range(config.relays)
    whole = [[f"relay_{tile}_{stage}" for stage in relays] for tile in tiles]
    for tile, line in enumerate(whole):
        last = f"{line[-1]}.event_valid"
        yield f"an event of tile {tile} in every station", " && ".join(f"{station}.event_valid" for station in line)
        yield f"the stall has reached tile {tile}", " && ".join(f"{station}.full" for station in line)
        yield f"event of tile {tile} waits for another tile", f"{last} && merge.comes && !merge.tile_ready[{tile}]"
        yield f"event of tile {tile} alone on its way", f"{line[0]}.event_valid && !(|merge.tile_valid)"
    every = [station for line in whole for station in line]
    yield "all stations full", " && ".join(f"{station}.full" for station in every)
    yield "all stations empty", "!rst && " + " && ".join(f"!{station}.event_valid" for station in every)
    yield "all lines offer", "&merge.tile_valid"
    yield "sample tick of all tiles", "&sample_valid"
    some = " || ".join(f"{station}.full" for station in every)
    yield "sample tick while a stall reaches a tile", f"(&sample_valid) && ({some})"
