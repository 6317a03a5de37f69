"""Coverage points of every design."""

import itertools
from collections.abc import Iterator

from eskin.board.config import BoardConfig
from eskin.board.records import Reason
from eskin.board.serial_frames import MOST_PAYLOAD
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig, highest, lowest
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.frame_words import bit_positions
from eskin.model.tiles.config import MergeConfig, TilesConfig
from eskin.rtl.verilog import Config
from eskin.verify.coverage.points.point import Named, Point, points_of, table
from eskin.verify.coverage.points.readout import readout
from eskin.verify.coverage.points.registers import registers

STATES = (
    "at rest",
    "adding an event",
    "adding recurrent spikes",
    "comparing",
    "in the gap",
    "adding to outputs",
    "ending",
)


def points(config: Config | BoardConfig) -> list[Point]:
    """Return the coverage points of a configuration."""
    if isinstance(config, BoardConfig):
        return list(board(config))
    if isinstance(config, TilesConfig):  # a readout too, of tiles
        return [*merge(config), *(lines(config) if config.relays else ())]
    if isinstance(config, ReadoutConfig):
        return list(registers(config) if config.registers == "spi" else readout(config))
    if isinstance(config, FrameConfig):
        return list(frames(config))
    if isinstance(config, ClassifierConfig):
        return list(classifier(config))
    if isinstance(config, ChipConfig):
        return list(chip(config))
    assert isinstance(config, MergeConfig)
    return list(merge(config.skin))


def frames(config: FrameConfig) -> Iterator[Point]:
    """Return the coverage points of a frame readout."""
    group = f"frames {config.rows} x {config.columns}, {config.resolution} in {config.word_bits} bits"
    bits = config.resolution
    waits = "sequencer.sample_valid && !sequencer.sample_ready"
    values = {"bits": bits, "two_n": 2 * bits, "lowest": 1 << bits - 1, "highest": (1 << bits - 1) - 1, "waits": waits}
    parts = (table("sequencer", **values), _taxels(config), _words(config))
    return points_of(group, "eskin_frame_readout", *parts)


def _taxels(config: FrameConfig) -> Named:
    for row in range(config.rows):
        for column in range(config.columns):
            here = f"row_select == {1 << row} && column_select == {1 << column}"
            yield f"conversion of taxel {row}, {column}", f"adc_start && {here}"


def _words(config: FrameConfig) -> Named:
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
    tiles = config.tiles
    own = table("merge", last=f"tile_valid[{tiles - 1}:1] & behind", tiles=tiles)
    return points_of(f"merge of {tiles} tiles", "eskin_merge", _offers(tiles), own, _polarity(config))


def _offers(tiles: int) -> Named:
    for tile in range(tiles):
        yield f"event of tile {tile} taken", f"tile_valid[{tile}] && tile_ready[{tile}]"
        yield f"tile {tile} alone offers", f"tile_valid == {1 << tile}"


def _polarity(config: TilesConfig) -> Named:
    return table("polarity") if config.tile.has_polarity else iter(())


def lines(config: TilesConfig) -> Iterator[Point]:
    """Yield the coverage points of relay stations and lines."""
    kind = f"{config.tile.encoding}, reset {config.reset}"
    parts = (table("relay"), _addresses(config), _polarity(config))
    yield from points_of(f"relay station {kind}", "eskin_relay", *parts)
    group = f"{config.relays} relay stations a line, {config.tiles} tiles {kind}"
    yield from points_of(group, "eskin_tiles", _stations(config))


def _addresses(config: TilesConfig) -> Named:
    for name, bits in (("row", config.tile.row_bits), ("col", config.tile.column_bits)):
        for end, value in (("first", 0), ("last", (1 << bits) - 1)):
            if bits:
                yield f"{end} {name} leaves", f"event_valid && event_ready && event_{name} == {value}"


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


def board(config: BoardConfig) -> Iterator[Point]:
    """Yield the coverage points of a board: serial line, frames, queries, records, and its chip or another one."""
    values = {"longest": MOST_PAYLOAD + 7, "words": MOST_PAYLOAD // 4, "records": config.serial.records}
    values |= {reason.name.lower(): int(reason) for reason in Reason}
    group = f"board, {config.design}"
    for part in ("uart_receiver", "frames", "core", "core_recorder", "core_sender"):
        yield from points_of(group, f"eskin_board_{part}", table(f"board_{part}", **values))
    yield from points_of(group, "eskin_board_core", table(f"board_{config.design}"))
    if config.chip:
        yield from points_of(group, "eskin_board_core", loads(config.chip.classifier))


def classifier(config: ClassifierConfig) -> Iterator[Point]:
    """Return the coverage points of a classifier."""
    kind = f"{config.neuron_reset}, {config.membrane_bits} bits, {config.classes} classes"
    group = f"classifier {config.readout}, reset to {kind}"
    parts = (table("classifier"), _states(), loads(config), _ends(config), _classes(config))
    return points_of(group, "eskin_classifier", *parts)


def _states() -> Named:
    """Yield the points of events, bin ends and scan starts in every state."""
    for state, name in enumerate(STATES):
        if state:
            yield f"event waits while {name}", f"event_valid && !event_ready && state == {state}"
        yield f"bin ends while {name}", f"bin_end && state == {state} && !scan_start"
        yield f"scan begins while {name}", f"scan_start && state == {state}"


def loads(config: ClassifierConfig) -> Named:
    """Yield the points of first and last words of both weight memories."""
    for memory, words, chosen in (
        ("rows", config.weight_words, "!load_neurons"),
        ("neurons", config.neuron_words, "load_neurons"),
    ):
        for place, address in (("first", 0), ("last", words - 1)):
            yield f"{place} word of {memory} written", f"load_valid && {chosen} && load_address == {address}"


def _ends(config: ClassifierConfig) -> Named:
    parts = [("hidden", config.membrane_bits, config.floor, config.saturates)]
    if config.readout == "spikes":
        parts += [("output", config.output_bits, config.out_floor, config.output_saturates)]
    for name, bits, floor, saturates in parts:
        value, valid = f"{name}_potential", f"{name}_valid"
        yield f"{name} neuron fires", f"{valid} && {name}_spike"
        yield f"{name} neuron does not fire", f"{valid} && !{name}_spike"
        if saturates:
            yield f"{name} potential at the top", f"{valid} && {value} == {highest(bits)}"
            if floor is None:
                yield f"{name} potential at the bottom", f"{valid} && {value} == {lowest(bits)}"
        if floor is not None:
            yield f"{name} potential at its floor", f"{valid} && {value} == {floor}"


def _classes(config: ClassifierConfig) -> Named:
    bits = config.evidence_bits
    for number in range(config.classes):
        yield f"class {number} found", f"class_valid && class_index == {number}"
    if config.classes > 1:
        first, second = (f"evidence[{number * bits} +: {bits}]" for number in (0, 1))
        yield "equal evidence: the first stays", f"class_valid && {first} == {second} && class_index == 0"
        yield "class changes", "class_valid && class_index != $past(class_index)"
    if config.readout == "spikes" and bits < 8:
        top = highest(bits)
        yield "evidence at the top", f"class_valid && $signed(evidence[0 +: {bits}]) == {top}"


def chip(config: ChipConfig) -> Iterator[Point]:
    """Return the coverage points of a chip."""
    return points_of(f"chip {config.readout.encoding}", "eskin_chip", table("chip"))
