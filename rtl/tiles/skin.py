"""A skin: tiles with readouts, relay stations and the merge."""

from typing import Any

from amaranth.hdl import Module, Shape, unsigned
from amaranth.lib.wiring import In

from eskin.base.errors import InputError
from eskin.model.tiles.config import TilesConfig
from eskin.rtl.arbiter import event_ports
from eskin.rtl.block import Block
from eskin.rtl.readout import Readout
from eskin.rtl.tiles.merge import Merge, merged_ports
from eskin.rtl.tiles.relay import Relay

MAX_INPUT_BITS = 65_000
"""Most input bits of a module: Amaranth numbers them with 16 bits."""


class Skin(Block[TilesConfig]):
    """Top module of a skin; tile i has slice i of every port that the tiles do not share.

    Attributes
    ----------
    event_valid, event_ready, event_tile, event_row, event_col, event_polarity
        The stream of all events, see ``Merge``.
    others
        Those of ``Readout``, one after the other for each tile, but for ``sample_valid``, which is common. With relay
        stations each tile has its own: a line to all of them would take longer than a clock may.
    """

    module_name = "eskin_tiles"

    def __init__(self, config: TilesConfig) -> None:
        members = Readout(config.tile).signature.members
        self.stream = event_ports(config.tile, In)
        self.outer = [name for name in members if name not in self.stream]
        ports = {}
        for name in self.outer:
            width = Shape.cast(members[name].shape).width * (1 if name in common_ports(config) else config.tiles)
            ports[name] = members[name].flow(unsigned(width))
        inputs = sum(Shape.cast(port.shape).width for port in ports.values() if port.flow is In)
        if inputs > MAX_INPUT_BITS:
            raise InputError(
                f"{config.tiles} tiles of {config.tile.rows} x {config.tile.columns} taxels have {inputs} input bits, "
                f"but a module has at most {MAX_INPUT_BITS}; write the merge with --merge, and a tile without --tiles"
            )
        super().__init__(config, ports | merged_ports(config))

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        merge = Merge(self.config)
        merge.place(m, "merge", platform)
        merge.connect_all(m, self, merged_ports(self.config))
        for index in range(self.config.tiles):
            tile = Readout(self.config.tile)
            tile.place(m, f"tile_{index}", platform)
            for name in self.outer:
                outside, width = getattr(self, name), len(getattr(tile, name))
                common = name in common_ports(self.config)
                tile.connect(m, name, outside if common else outside.word_select(index, width))
            source: Block[Any] = tile
            for stage in range(self.config.relays):
                relay = Relay(self.config)
                relay.place(m, f"relay_{index}_{stage}", platform)
                for name in self.stream:
                    source.connect(m, name, getattr(relay, name.replace("event_", "tile_")))
                source = relay
            for name in self.stream:
                outside = getattr(merge, name.replace("event_", "tile_"))
                source.connect(m, name, outside.word_select(index, len(getattr(source, name))))
        return m


def common_ports(config: TilesConfig) -> tuple[str, ...]:
    """Return the inputs common to all tiles of a skin, except clock and reset."""
    return () if config.relays else ("sample_valid",)
