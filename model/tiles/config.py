"""Configuration of a skin of tiles, each with its own readout (docs/reference/tiles.md)."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.configuration import parameter
from eskin.base.errors import InputError
from eskin.model.address_events import Events
from eskin.model.config import ReadoutConfig

MAX_TILES = 64
"""Most tiles of a skin: their requests fit one 64-bit word of the model."""

MAX_RELAYS = 16
"""Most relay stations on a line; one for every few millimetres is enough."""

TILES = "docs/reference/tiles.md"


@dataclass(frozen=True, kw_only=True)
class TilesConfig(ReadoutConfig):
    """A skin of identical tiles in rows and columns, whose events are merged into one stream.

    ``rows`` and ``columns`` are those of the whole skin, so its event files are read like any other; ``tile`` is the
    readout of one tile. Tile (r, c) of the skin has index ``r * tile_columns + c``. A relay station takes an event one
    clock.

    Examples
    --------
    >>> skin = TilesConfig.of(ReadoutConfig(rows=64, columns=64), 4, 4)
    >>> skin.rows, skin.columns, skin.tiles, skin.taxels, skin.event_bits
    (256, 256, 16, 65536, 17)
    >>> skin.tile == ReadoutConfig(rows=64, columns=64)
    True
    """

    tile_rows: int = parameter(1, "", TILES, "rows of tiles")
    tile_columns: int = parameter(1, "", TILES, "columns of tiles, 64 tiles at most")
    relays: int = parameter(0, "", TILES, "relay stations on the line from each tile to the merge")

    @classmethod
    def of(cls, tile: ReadoutConfig, tile_rows: int, tile_columns: int, relays: int = 0) -> TilesConfig:
        """Return the skin with the given number of tile rows and columns."""
        own = {"tile_rows": tile_rows, "tile_columns": tile_columns, "relays": relays}
        return cls(**tile.to_dict() | {"rows": tile.rows * tile_rows, "columns": tile.columns * tile_columns} | own)

    def to_dict(self) -> dict[str, Any]:
        """Return all fields as a dictionary, without unused registers and relay stations."""
        fields = super().to_dict()
        if not self.relays:
            del fields["relays"]
        return fields

    def _check_array(self) -> None:
        for name in ("tile_rows", "tile_columns"):
            self._check_range(name, 1, MAX_TILES)
        self._check_range("relays", 0, MAX_RELAYS)
        if self.tiles > MAX_TILES:
            raise InputError(f"a merge takes at most {MAX_TILES} tiles, not {self.tile_rows} x {self.tile_columns}")
        for name, parts in (("rows", self.tile_rows), ("columns", self.tile_columns)):
            if getattr(self, name) % parts:
                raise InputError(
                    f"{name} must be a multiple of {parts}, the tiles in this direction, not {getattr(self, name)}"
                )
        if not self.protocol.streams:
            raise InputError(f"tiles need the link stream to their merge, not {self.link}; leave --link out")
        if self.registers != "none":
            raise InputError(f"tiles of a skin have no registers, not {self.registers}; leave --registers out")
        if self.receptive_fields != "own":
            raise InputError(
                "tiles of a skin have no receptive fields, because fields would end at tile edges; "
                "leave receptive_fields out"
            )
        _ = self.tile  # its sides are checked

    @property
    def tile(self) -> ReadoutConfig:
        """Configuration of the readout of one tile."""
        own = ("tile_rows", "tile_columns", "relays")
        fields = {name: value for name, value in self.to_dict().items() if name not in own}
        sides = {"rows": self.rows // self.tile_rows, "columns": self.columns // self.tile_columns}
        return ReadoutConfig(**fields | sides)

    @property
    def tiles(self) -> int:
        """Number of tiles."""
        return self.tile_rows * self.tile_columns

    @property
    def tile_bits(self) -> int:
        """Bits of a tile address; 0 for one tile."""
        return (self.tiles - 1).bit_length()

    @property
    def event_bits(self) -> int:
        """Bits of one address event {polarity, tile, row, column}."""
        return self.tile_bits + self.tile.event_bits

    def on_skin(self, tile: Any, events: Events) -> Events:
        """Return events of a tile, or of the tile that sent each event, with their addresses on the skin."""
        moved = events.copy()
        moved["y"] += (np.asarray(tile) // self.tile_columns * (self.rows // self.tile_rows)).astype(np.int16)
        moved["x"] += (np.asarray(tile) % self.tile_columns * (self.columns // self.tile_columns)).astype(np.int16)
        return moved

    def in_tiles(self, events: Events) -> tuple[NDArray[np.int64], Events]:
        """Return the tile of each event, and the events with addresses within their tiles."""
        tile_row, y = np.divmod(events["y"], self.rows // self.tile_rows)
        tile_column, x = np.divmod(events["x"], self.columns // self.tile_columns)
        moved = events.copy()
        moved["y"], moved["x"] = y, x
        return tile_row.astype(np.int64) * self.tile_columns + tile_column, moved

    def taxels_of(self, tile: int) -> NDArray[np.int64]:
        """Return the skin indices of the taxels of a tile, shape (taxels of a tile,)."""
        rows, columns = self.rows // self.tile_rows, self.columns // self.tile_columns
        tile_row, tile_column = divmod(tile, self.tile_columns)
        row, column = np.arange(rows) + tile_row * rows, np.arange(columns) + tile_column * columns
        return (row[:, None] * self.columns + column).ravel()


@dataclass(frozen=True)
class MergeConfig:
    """Configuration of the merge alone, for tiles that are separate chips."""

    skin: TilesConfig

    reset = property(attrgetter("skin.reset"), doc="Reset style of the flip-flops.")
    clock_hz = property(attrgetter("skin.clock_hz"), doc="Clock frequency in hertz.")

    def to_dict(self) -> dict[str, Any]:
        """Return all fields as a dictionary."""
        return self.skin.to_dict()


def tiles_of(text: str) -> tuple[int, int]:
    """Return the tile rows and tile columns for a text such as ``4x4``."""
    rows, _, columns = text.partition("x")
    if not (rows.isdecimal() and columns.isdecimal()):
        raise InputError(f"tiles must be rows and columns such as 4x4, not {text!r}")
    return int(rows), int(columns)


def skin_of(tile: ReadoutConfig, tiles: str, relays: int = 0) -> TilesConfig:
    """Return the skin for a tile, a text such as ``4x4``, and a number of relay stations."""
    return TilesConfig.of(tile, *tiles_of(tiles), relays)


def config_of(fields: Any) -> ReadoutConfig:
    """Return the configuration for a dictionary: a skin if it has tiles, else one readout."""
    has_tiles = isinstance(fields, dict) and "tile_rows" in fields
    return TilesConfig.from_dict(fields) if has_tiles else ReadoutConfig.from_dict(fields)
