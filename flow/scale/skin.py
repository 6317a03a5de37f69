"""Model of a skin as cells: tiles, relay stations and merge."""

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from amaranth.lib.wiring import Out
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from eskin.flow.liberty.library import Library
from eskin.flow.scale.array import NONE, TREES, Array, as_cells, build
from eskin.flow.scale.placement import Placement
from eskin.model.tiles.config import TilesConfig
from eskin.rtl.arbiter import event_ports
from eskin.rtl.tiles.merge import Merge, merged_ports
from eskin.rtl.tiles.relay import Relay
from eskin.rtl.tiles.skin import common_ports

MERGE = -1
"""Stage number of the merge, after the last relay station."""


class Spot(NamedTuple):
    """Owner of a cell: a tile, a relay station of a line, or the merge (``tile`` -1)."""

    tile: int
    cell: int = NONE
    station: int = NONE


def build_skin(config: TilesConfig, library: Library) -> tuple[Array, Array, list[Spot]]:
    """Return a skin as library cells, the array of one tile as returned by ``build``, and the owner of each cell."""
    tile = build(config.tile, library)
    merge = as_cells(Merge(config), config, library)
    relay = as_cells(Relay(config), config, library) if config.relays else None
    kinds = tile.kinds | merge.kinds | (relay.kinds if relay else {})

    work = _Assembly(config, kinds, tile)
    into = work.place(merge, "merge", [Spot(MERGE)] * len(merge.cells))
    stream = list(event_ports(config.tile, Out))
    for index in range(config.tiles):
        source = work.place_tile(index)
        stations = [
            work.place(relay, f"relay_{index}_{station}", [Spot(index, NONE, station)] * len(relay.cells))
            for station in range(config.relays)
            if relay
        ]
        for station in stations:
            for name in stream:
                work.join(source[name], station[name.replace("event_", "tile_")])
            source = station
        for name in stream:
            width = len(source[name])
            work.join(source[name], into[name.replace("event_", "tile_")][index * width : (index + 1) * width])
    for name, port in merged_ports(config).items():
        work.port("output" if port.flow is Out else "input", name, into[name])
    return work.array(), tile, work.spots


class _Assembly:
    """Skin under construction from its parts."""

    def __init__(self, config: TilesConfig, kinds: dict[str, Any], tile: Array) -> None:
        taxels: list[dict[str, int]] = [{} for _ in range(config.taxels)]
        self.made = Array(config, kinds, [], [], [], tile.taxel, tile.taxel_bits, taxels, [], 0)
        self.config, self.tile = config, tile
        self.joined: list[tuple[int, int]] = []
        self.spots: list[Spot] = []
        self.common: dict[str, list[int]] = {}

    def join(self, nets: list[int], others: list[int]) -> None:
        """Join pairs of nets or constants."""
        self.joined += zip(nets, others, strict=True)

    def place(self, part: Array, name: str, spots: list[Spot]) -> dict[str, list[int]]:
        """Add a part and connect its common ports; return the nets of its ports."""
        first = self.made.nets
        self.made.nets += part.nets
        for cell, kind, pins in zip(part.names, part.cells, part.pins, strict=True):
            self.made.add(f"{name}.{cell}", kind, {pin: _moved(net, first) for pin, net in pins.items()})
        self.spots += spots
        ports: dict[str, list[int]] = {}
        for _, port, _, net in part.ports:
            ports.setdefault(port, []).append(_moved(net, first))
        for port in (*TREES, *common_ports(self.config)):
            if port in ports:
                if port not in self.common:
                    self.common[port] = [self.made.new_net()]
                    self.port("input", port, self.common[port])
                self.join(self.common[port], ports[port])
        return ports

    def place_tile(self, index: int) -> dict[str, list[int]]:
        """Add a tile with its ports; return the nets of the ports."""
        first = self.made.nets
        ports = self.place(self.tile, f"tile_{index}", [Spot(index, cell) for cell in range(len(self.tile.cells))])
        for number, taxel in zip(self.config.taxels_of(index), self.tile.taxels, strict=True):
            self.made.taxels[int(number)] = {bit: _moved(net, first) for bit, net in taxel.items()}
        ways = {name: way for way, name, _, _ in self.tile.ports}
        for name, nets in ports.items():
            if not name.startswith("event_") and name not in self.common:
                self.port(ways[name], name, nets, index * len(nets))
        return ports

    def port(self, way: str, name: str, nets: list[int], first: int = 0) -> None:
        """Add bits of a port of the skin."""
        self.made.ports += [(way, name, first + bit, net) for bit, net in enumerate(nets)]

    def array(self) -> Array:
        """Return the complete skin as an array with new net numbers."""
        made, size = self.made, self.made.nets + 1  # the last node stands for constants
        ends = np.array(self.joined).T % size
        _, groups = connected_components(coo_matrix((np.ones(len(ends[0])), ends), (size, size)), directed=False)
        constant = groups[-1]
        numbers = {group: n for n, group in enumerate(dict.fromkeys(groups[groups != constant]))} | {constant: NONE}
        of = [numbers[group] for group in groups]
        return dataclasses.replace(
            made,
            pins=[{pin: of[net] for pin, net in pins.items()} for pins in made.pins],
            taxels=[{bit: of[net] for bit, net in taxel.items()} for taxel in made.taxels],
            ports=[(way, name, bit, of[net]) for way, name, bit, net in made.ports],
            nets=len(numbers) - 1,
        )


def _moved(net: int, first: int) -> int:
    return NONE if net == NONE else first + net


class SkinPlacement(Placement):
    """Positions of cells in a skin: placed tiles, with the merge in the middle.

    The first relay station of a line is at its tile, where the stream leaves it, the last at the merge, and the others
    at equal ways between; one alone is at the tile.
    """

    def __init__(self, array: Array, pitch_um: float, tile: Array, spots: list[Spot]) -> None:
        assert isinstance(array.config, TilesConfig)
        self.skin, self.tile, self.spots = array.config, Placement(tile, pitch_um), spots
        self.within = [self.skin.taxels_of(index).tolist() for index in range(self.skin.tiles)]
        super().__init__(array, pitch_um)

    def _port(self, name: str, bit: int) -> tuple[float, float]:
        taxels = self.rows * self.columns
        if self.widths[name] % taxels == 0 and not name.startswith("event_"):
            each = self.widths[name] // taxels
            tile, taxel = divmod(bit // each, self.skin.tile.taxels)
            return self._taxel(self.within[tile][taxel])
        if name == "sample_valid" and self.skin.relays:  # that of a tile alone is at the tile, as its samples are
            x, y = self._corner(bit)
            return x, y + self.tile.rows * self.pitch_um / 2
        return 0.0, self.rows * self.pitch_um / 2

    def _least_squares(self) -> list[tuple[float, float]]:
        return [self._spot(spot) for spot in self.spots]

    def _corner(self, tile: int) -> tuple[float, float]:
        """Return the position of a tile."""
        down, across = divmod(tile, self.skin.tile_columns)
        return across * self.tile.columns * self.pitch_um, down * self.tile.rows * self.pitch_um

    def _spot(self, spot: Spot) -> tuple[float, float]:
        """Return the position of a cell."""
        middle = self.columns * self.pitch_um / 2, self.rows * self.pitch_um / 2
        if spot.tile == MERGE:
            return middle
        corner = self._corner(spot.tile)
        if spot.station == NONE:
            x, y = self.tile.of_cells[spot.cell]
            return corner[0] + x, corner[1] + y
        leaves = corner[0], corner[1] + self.tile.rows * self.pitch_um / 2
        share = spot.station / max(1, self.skin.relays - 1)
        return leaves[0] + share * (middle[0] - leaves[0]), leaves[1] + share * (middle[1] - leaves[1])
