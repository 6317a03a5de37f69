"""Relay station: registers for events and ready on a long line from a tile to the merge."""

from typing import Any

from amaranth.hdl import Cat, Module, Mux, Signal, Value
from amaranth.lib.wiring import In, Out

from eskin.model.tiles.config import TilesConfig
from eskin.rtl.arbiter import event_ports
from eskin.rtl.block import Block


class Relay(Block[TilesConfig]):
    """Relay station whose outputs depend only on flip-flops.

    The relay station of L. P. Carloni, K. L. McMillan and A. L. Sangiovanni-Vincentelli, Theory of
    latency-insensitive design, IEEE TCAD 20(9), 2001: two places, since a stall reaches the tile a clock late.

    Latency: taken at clock t, at the output at t + 1. Throughput: one event per clock.

    Attributes
    ----------
    tile_valid, tile_ready, tile_row, tile_col, tile_polarity : In(1), Out(1), In(bits) ...
        The stream of a tile, or of the station before; zero-width fields are absent.
    event_valid, event_ready, event_row, event_col, event_polarity
        The same stream, on its way to the merge.
    """

    module_name = "eskin_relay"

    def __init__(self, config: TilesConfig) -> None:
        before = {f"tile{name.removeprefix('event')}": port for name, port in event_ports(config.tile, In).items()}
        super().__init__(config, before | event_ports(config.tile, Out))

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        new = {name: getattr(self, f"tile_{name}") for name in payload_fields(self.config)}
        full = Signal()
        comes = Signal()
        m.d.comb += [comes.eq(self.tile_valid & ~full), self.tile_ready.eq(~full)]
        two_places(m, self, full, comes, new)
        return m


def payload_fields(config: TilesConfig) -> list[str]:
    """Return the fields of a tile's event, least significant first, without zero-width fields."""
    ports = event_ports(config.tile, In)
    return [name for name in ("col", "row", "polarity") if f"event_{name}" in ports]


def two_places(m: Module, block: Block[Any], full: Signal, comes: Signal, new: dict[str, Value]) -> None:
    """Add an output buffer of two events to a block with ``event_valid``, ``event_ready`` and ``event_FIELD``.

    ``full``, a flop that is driven here: both places are taken. ``comes``: an event is taken in this clock, never while
    the buffer is full; ``new`` is its payload, field by field.
    """
    valid = Signal()
    moves = ~valid | block.event_ready
    m.d.comb += block.event_valid.eq(valid)
    with m.If(moves):
        m.d.sync += [valid.eq(full | comes), full.eq(0)]
    with m.Elif(comes):
        m.d.sync += full.eq(1)

    outputs = [getattr(block, f"event_{name}") for name in new]
    if outputs:
        held, spare = (Signal(sum(map(len, outputs)), name=name) for name in ("held", "spare"))
        with m.If(moves & (full | comes)):
            m.d.sync += held.eq(Mux(full, spare, Cat(new.values())))
        with m.If(comes & ~moves):
            m.d.sync += spare.eq(Cat(new.values()))
        m.d.comb += Cat(outputs).eq(held)
