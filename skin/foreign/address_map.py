"""Map the event addresses of another chip to taxels."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.config import MAX_SIDE
from eskin.skin.samples import content_of

Addresses = NDArray[np.int64]  # shape (events,) for single addresses, or (events, 2) for columns and rows

HEADERS = (("address", "x", "y"), ("from_x", "from_y", "x", "y"))
"""Columns of a map: the foreign address, or the foreign column and row; then the taxel's column and row."""


@dataclass(frozen=True)
class AddressMap:
    """A map from the addresses of another chip to taxels."""

    taxels: dict[tuple[int, ...], tuple[int, int]]
    """Map from ``(address,)`` or ``(column, row)`` of the chip to (x, y) of the readout."""
    name: str  # the file, for messages

    @classmethod
    def read(cls, path: Path) -> AddressMap:
        """Return the map from a .csv file with the header ``address,x,y`` or ``from_x,from_y,x,y``.

        Raise InputError if the file is not such a table, contains other values than integers, or repeats an address or
        a taxel.
        """
        try:
            text = content_of(path, "the address map").decode("utf-8-sig")
            lines = [line for line in csv.reader(text.splitlines()) if line]
        except (UnicodeDecodeError, csv.Error):
            raise InputError(f"{path} is no table; an address map is a .csv with the header {_headers()}") from None
        header = tuple(cell.strip().lower() for cell in lines[0]) if lines else ()
        if header not in HEADERS:
            raise InputError(f"{path} has the header {','.join(header)!r}; an address map has {_headers()}")
        taxels: dict[tuple[int, ...], tuple[int, int]] = {}
        for number, line in enumerate(lines[1:], 2):
            try:
                *source, x, y = (int(cell) for cell in line)
            except ValueError:
                raise InputError(
                    f"{path}, line {number}: {','.join(line)!r} is not {len(header)} whole numbers"
                ) from None
            if len(source) != len(header) - 2:
                raise InputError(f"{path}, line {number} has {len(line)} cells; the header has {len(header)}")
            if not (0 <= x < MAX_SIDE and 0 <= y < MAX_SIDE):
                raise InputError(f"{path}, line {number}: taxel ({x}, {y}) is outside 0..{MAX_SIDE - 1}")
            if tuple(source) in taxels:
                raise InputError(f"{path}, line {number}: address {_text(source)} occurs twice; keep one line")
            taxels[tuple(source)] = (x, y)
        if not taxels:
            raise InputError(f"{path} maps no address; add a line for each taxel")
        if len(set(taxels.values())) < len(taxels):
            places = list(taxels.values())
            twice = next(place for place in places if places.count(place) > 1)
            raise InputError(f"{path} gives two addresses for taxel {twice}; keep one line")
        return cls(taxels, str(path))

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns of the smallest array that holds all mapped taxels."""
        columns, rows = np.array(list(self.taxels.values())).max(axis=0) + 1
        return int(rows), int(columns)

    def apply(self, addresses: Addresses, drop: bool = False) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return x and y of the events that have a taxel, shape (kept, 2), and which events these are.

        Events of other addresses raise InputError, unless ``drop`` leaves them out.
        """
        pairs = addresses[:, None] if addresses.ndim == 1 else addresses
        length = len(next(iter(self.taxels)))
        if pairs.shape[1] != length:
            wanted, found = (HEADERS[n - 1][0] for n in (pairs.shape[1], length))
            raise InputError(
                f"{self.name} maps {found}, but the events have {wanted}; write the map for their addresses"
            )
        unique, of_event = np.unique(pairs, axis=0, return_inverse=True)
        known = [self.taxels.get(tuple(map(int, address))) for address in unique]
        holes = np.array([taxel is None for taxel in known], bool)
        kept = ~holes[of_event.reshape(-1)]
        if not drop and not kept.all():
            first = int(np.flatnonzero(~kept)[0])
            raise InputError(
                f"{int((~kept).sum())} events have an address that {self.name} does not map; event {first} "
                f"has {_text(pairs[first])}; map this address, or leave such events out with --drop-unmapped"
            )
        table = np.array([taxel or (0, 0) for taxel in known], np.int64).reshape(-1, 2)
        return table[of_event.reshape(-1)[kept]], kept


def _headers() -> str:
    return " or ".join(",".join(header) for header in HEADERS)


def _text(address: Any) -> str:
    numbers = [str(int(number)) for number in address]
    return numbers[0] if len(numbers) == 1 else f"({', '.join(numbers)})"
