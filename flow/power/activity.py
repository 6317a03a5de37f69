"""What the nets of a netlist did in a simulation: their values after every edge of the clock."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from model.errors import InputError

HALF_NS = 4
"""Half a clock of the harness, in units of its time."""
DUMP = "activity.vcd"
"""File that a simulation dumps into."""


@dataclass(frozen=True)
class Activity:
    """Values of nets in some clocks.

    Attributes
    ----------
    clocks : int
    values : dict of str to ndarray of bool, shape (1 + 2 * clocks,)
        Before the first edge and after every one; a net that never changes has a shape of one.
    """

    clocks: int
    values: dict[str, NDArray[np.bool_]]

    @functools.cached_property
    def _toggles(self) -> dict[str, int]:
        return {net: int(np.count_nonzero(bits[1:] != bits[:-1])) for net, bits in self.values.items()}

    def toggles(self, net: str) -> float:
        """Return the toggles of a net per clock."""
        return self._toggles[net] / self.clocks


def take_dump(folder: Path, lead: int, clocks: int, nets: Iterable[str]) -> Activity:
    """Return what nets did in a simulation, and delete its dump, which is large.

    Parameters
    ----------
    folder : Path
        Where the simulation ran.
    lead : int
        Time from the beginning of the dump to the first rising edge of the window.
    clocks : int
        Length of the window.
    nets : iterable of str
    """
    path = folder / DUMP
    activity = read_vcd(path, first_time(path) + lead, clocks, nets)
    path.unlink()
    return activity


def read_vcd(path: Path, start: int, clocks: int, nets: Iterable[str]) -> Activity:
    """Return what nets did in a window of a value change dump.

    Parameters
    ----------
    path : Path
        Dump of one module, written by Icarus; a net of several bits is dumped as a word.
    start : int
        Time of the first rising edge of the window.
    clocks : int
        Its length.
    nets : iterable of str
        Their names, ``n12`` or ``sample[3]``.

    Raises
    ------
    InputError
        If a net is unknown in the window, or missing in the dump.
    """
    codes, changes = _changes(path)
    edges = start + HALF_NS * np.arange(-1, 2 * clocks)
    values: dict[str, NDArray[np.bool_]] = {}
    waves: dict[str, NDArray[np.uint8]] = {}
    for net in nets:
        name, _, bit = net.partition("[")
        if name not in codes:
            raise InputError(f"the dump of the simulation has no net {name}; simulate the netlist that is measured")
        code, lowest, width = codes[name]
        if code not in waves:
            waves[code] = _sampled(changes.get(code, []), edges, width)
        column = waves[code][:, width - 1 - (int(bit[:-1]) - lowest if bit else 0)]
        if (column > 1).any():
            raise InputError(f"net {net} is unknown in the simulation; reset must make all nets known")
        bits = column.astype(bool)
        values[net] = bits if (bits[1:] != bits[:-1]).any() else bits[:1]
    return Activity(clocks, values)


def first_time(path: Path) -> int:
    """Return the time of the first values in a dump."""
    with path.open() as file:
        return next(int(line[1:]) for line in file if line.startswith("#"))


def _changes(path: Path) -> tuple[dict[str, tuple[str, int, int]], dict[str, list[tuple[int, str]]]]:
    """Return the code, lowest bit and width of every variable of a dump, and the changes of every code."""
    codes: dict[str, tuple[str, int, int]] = {}
    changes: dict[str, list[tuple[int, str]]] = {}
    time = 0
    with path.open() as file:
        for line in file:
            if line.startswith("$var"):
                _, _, width, code, name, *rest = line.split()
                found = re.match(r"\[\d+:(\d+)\]", rest[0]) if rest else None
                codes[name] = (code, int(found[1]) if found else 0, int(width))
            elif line.startswith("$enddefinitions"):
                break
        for line in file:
            first = line[0]
            if first == "#":
                time = int(line[1:])
            elif first in "01xzXZ":
                changes.setdefault(line[1:-1], []).append((time, first))
            elif first == "b":
                value, code = line[1:].split()
                changes.setdefault(code, []).append((time, value))
    return codes, changes


def _sampled(changes: list[tuple[int, str]], edges: NDArray[np.int64], width: int) -> NDArray[np.uint8]:
    """Return the bits of a variable just after each of some times, highest first; 2 where unknown."""
    if not changes:
        return np.full((1, width), 2, np.uint8)
    times = np.array([time for time, _ in changes])
    words = [_padded(value, width) for _, value in changes]
    bits = np.frombuffer("".join(words).encode(), np.uint8).reshape(len(words), width)
    levels = np.where(bits == ord("1"), 1, np.where(bits == ord("0"), 0, 2)).astype(np.uint8)
    place = np.searchsorted(times, edges + HALF_NS - 1, side="right") - 1
    sampled = np.where(place[:, None] >= 0, levels[np.maximum(place, 0)], 2).astype(np.uint8)
    return sampled


def _padded(value: str, width: int) -> str:
    return value.rjust(width, value[0] if value[0] in "xz" else "0")
