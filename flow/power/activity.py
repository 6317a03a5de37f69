"""Read the activity of the nets of a netlist from a simulation."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from vcd.reader import ScalarChange, TokenKind, VectorChange, tokenize

from eskin.base.errors import InputError

HALF_NS = 4
"""Half a clock of the harness, in time units of the harness."""
DUMP = "activity.vcd"
"""File with the waveform dump of a simulation."""


@dataclass(frozen=True)
class Activity:
    """Sampled values of nets over a range of clocks."""

    clocks: int
    # shape (1 + 2 * parts * clocks,): before the first edge and after every edge, or at ``parts`` times in every half
    # of a clock; shape (1,) for a net that never changes
    values: dict[str, NDArray[np.bool_]]

    @functools.cached_property
    def _toggles(self) -> dict[str, int]:
        return {net: int(np.count_nonzero(bits[1:] != bits[:-1])) for net, bits in self.values.items()}

    def part(self, start: int, clocks: int) -> Activity:
        """Return the activity of a range of clocks; a clock has two values."""
        some = slice(2 * start, 2 * (start + clocks) + 1)
        return Activity(clocks, {net: bits[some] if len(bits) > 1 else bits for net, bits in self.values.items()})

    def toggles(self, net: str) -> float:
        """Return the number of toggles of a net per clock."""
        return self._toggles[net] / self.clocks


def read_dump(path: Path, lead: int, clocks: int, nets: Iterable[str], parts: int = 1) -> Activity:
    """Return the activity of nets in a window of a VCD file.

    ``path``: dump of one module, written by Icarus; a net of several bits is dumped as a word.
    ``lead``: time from the beginning of the dump to the first rising edge of the window.
    ``clocks``: length of the window.
    ``nets``: names such as ``n12`` or ``sample[3]``.
    ``parts``: samples in every half of a clock; above 1 the dump has units of a part, else of 1 ns.
    Raises InputError if a net is unknown in the window, or missing in the dump.
    """
    variables, times, changes = _changes(path)
    unit = HALF_NS if parts == 1 else 1
    first = lead * parts // HALF_NS if parts > 1 else lead
    edges = times[0] + first + unit * np.arange(-1, 2 * parts * clocks)
    values: dict[str, NDArray[np.bool_]] = {}
    waves: dict[str, NDArray[np.uint8]] = {}
    for net in nets:
        name, _, bit = net.partition("[")
        if name not in variables:
            raise InputError(f"the dump of the simulation has no net {name}; simulate the netlist that is measured")
        code, width, low = variables[name]
        if code not in waves:
            waves[code] = _sampled(changes[code], edges + unit - 1, width)
        column = waves[code][:, width - 1 - (int(bit[:-1]) - low if bit else 0)]
        if (column > 1).any():
            raise InputError(f"net {net} is unknown in the simulation; reset must make all nets known")
        bits = column.astype(bool)
        values[net] = bits if (bits[1:] != bits[:-1]).any() else bits[:1]
    return Activity(clocks, values)


def _changes(path: Path) -> tuple[dict[str, tuple[str, int, int]], list[int], dict[str, tuple[list[int], list[str]]]]:
    """Return the contents of a VCD file.

    These are code, width and lowest bit of each variable, the times, and times and values of every code's changes.
    """
    variables: dict[str, tuple[str, int, int]] = {}
    times: list[int] = []
    changes: dict[str, tuple[list[int], list[str]]] = {}
    with path.open("rb") as file:
        for token in tokenize(file):
            if token.kind is TokenKind.VAR:
                found, bits = token.var, token.var.bit_index
                low = bits[-1] if isinstance(bits, tuple) else bits or 0
                variables[found.reference] = found.id_code, found.size, low
                changes[found.id_code] = [], []
            elif token.kind is TokenKind.CHANGE_TIME:
                times.append(token.time_change)
            elif isinstance(token.data, ScalarChange | VectorChange):
                code, value = token.data
                stamps, values = changes[code]
                stamps.append(times[-1])
                values.append(f"{value:b}" if isinstance(value, int) else value)
    return variables, times, changes


def _sampled(changes: tuple[list[int], list[str]], edges: NDArray[np.int64], width: int) -> NDArray[np.uint8]:
    """Return the bits of a variable at given times, highest first; 2 where unknown."""
    times, values = changes
    if not times:
        return np.full((1, width), 2, np.uint8)
    words = [value.rjust(width, value[0] if value[0] in "xz" else "0") for value in values] if width > 1 else values
    bits = np.frombuffer("".join(words).encode(), np.uint8).reshape(len(words), width)
    levels = np.where(bits == ord("1"), 1, np.where(bits == ord("0"), 0, 2)).astype(np.uint8)
    place = np.searchsorted(times, edges, side="right") - 1
    return np.where(place[:, None] >= 0, levels[np.maximum(place, 0)], 2).astype(np.uint8)
