"""Merge of several event streams: round robin over the tiles, one event per clock."""

from typing import Any

from amaranth.hdl import Cat, Const, Module, Mux, Signal, Value
from amaranth.lib.wiring import In, Out

from eskin.model.tiles.config import TilesConfig
from eskin.rtl.arbiter import event_ports
from eskin.rtl.block import Block
from eskin.rtl.logic import encode, exclusive_prefix_or, or_tree
from eskin.rtl.tiles.relay import payload_fields, two_places


class Merge(Block[TilesConfig]):
    """Merge of the event streams of all tiles, two events deep.

    A tile's event is taken while fewer than two events are held. So neither ``tile_ready`` nor ``event_valid`` looks at
    ``event_ready`` in the same clock: no path leads through the merge from the sink to a tile.

    Latency: offered at clock t, at the output at t + 1. Throughput: one event per clock. An event leaves among the
    next tiles + 2 after it was offered; of n tiles that always offer one, each gets every n-th place.

    Attributes
    ----------
    tile_valid, tile_ready, tile_row, tile_col, tile_polarity : In(tiles), Out(tiles), In(tiles * bits) ...
        The streams of the tiles, tile 0 in the least significant bits; zero-width fields are absent.
    event_valid, event_ready, event_tile, event_row, event_col, event_polarity
        The stream of all events; zero-width fields are absent, so is ``event_tile`` of a single tile.
    """

    module_name = "eskin_merge"

    def __init__(self, config: TilesConfig) -> None:
        inner = event_ports(config.tile, In)
        ports = {f"tile{name.removeprefix('event')}": port for name, port in inner.items()}
        of_tiles = {name: port.flow(port.shape * config.tiles) for name, port in ports.items()}
        super().__init__(config, of_tiles | merged_ports(config))

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        tiles = self.config.tiles

        # The first offering tile behind the last taken tile, else the first of all, as the arbiter chooses its rows.
        behind = Signal(tiles - 1)
        candidates = Signal(tiles)
        chosen = Signal(tiles)
        later = self.tile_valid[1:] & behind
        thermometer = Cat(exclusive_prefix_or(candidates))
        m.d.comb += [
            candidates.eq(Mux(later.any(), Cat(Const(0, 1), later), self.tile_valid)),
            chosen.eq(candidates & ~thermometer),
        ]

        # The offered event, and one event behind it for the clock in which the sink stalls.
        full = Signal()
        comes = Signal()
        m.d.comb += [
            comes.eq(self.tile_valid.any() & ~full),
            self.tile_ready.eq(chosen & (~full).replicate(tiles)),
        ]
        with m.If(comes):
            m.d.sync += behind.eq(thermometer[1:])
        two_places(m, self, full, comes, self._fields_of(chosen))
        return m

    def _fields_of(self, chosen: Signal) -> dict[str, Value]:
        """Return the payload fields of the chosen tile."""
        fields = {}
        for name in payload_fields(self.config):
            words = getattr(self, f"tile_{name}")
            bits = len(words) // self.config.tiles
            gated = [words.word_select(i, bits) & chosen[i].replicate(bits) for i in range(self.config.tiles)]
            fields[name] = or_tree(gated)
        if self.config.tile_bits:
            fields["tile"] = encode(chosen)
        return fields


def merged_ports(config: TilesConfig) -> dict[str, Any]:
    """Return the ports of the merged event stream, without zero-width fields."""
    ports = event_ports(config.tile, Out)
    handshake = {name: ports.pop(name) for name in ("event_valid", "event_ready")}
    return handshake | ({"event_tile": Out(config.tile_bits)} if config.tile_bits else {}) | ports
