"""Cycle-accurate model of the relay stations on the lines from tiles to merge.

A station holds two events and takes an offered event while a place is free, like a merge of a single stream. State and
clock are therefore those of ``eskin.model.tiles.merge``.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from eskin.base.files import forget_stale_kernels
from eskin.model.tiles import merge

forget_stale_kernels(Path(__file__), [Path(str(merge.__file__))])

ZERO = np.uint64(0)


@njit(cache=True)
def room(line: NDArray[np.uint64]) -> bool:
    """Return True if the first station of a line takes an event in this clock."""
    return bool(line[0, merge.HELD] <= merge.ONE)


@njit(cache=True)
def offers(line: NDArray[np.uint64]) -> bool:
    """Return True if the last station of a line offers an event."""
    return bool(line[-1, merge.HELD] != ZERO)


@njit(cache=True)
def advance(line: NDArray[np.uint64], comes: bool, event: Any, ready: bool) -> None:
    """Advance all stations of a line, the tile's end first, by a clock edge.

    ``comes`` is true if the tile offers an event, any number from 0 on, and there is ``room`` for it; ``ready`` if the
    merge takes the event of the last station.
    """
    for station in range(len(line) - 1, 0, -1):  # stations behind have moved already, stations before have not
        before, own = line[station - 1], line[station]
        takes = before[merge.HELD] != ZERO and own[merge.HELD] <= merge.ONE
        merge.advance(own, 0 if takes else -1, before[merge.OFFERED], ready)
        ready = takes
    merge.advance(line[0], 0 if comes else -1, event, ready)


class Relayed(NamedTuple):
    """Clocks in which the first station of a line took each event, and in which the event left the last station."""

    taken: NDArray[np.int64]
    clock: NDArray[np.int64]


def relay(offered: NDArray[np.int64], ready: NDArray[np.uint8], clocks: int, stations: int = 1) -> Relayed:
    """Return the output events of a line of relay stations.

    ``offered`` has the first clock in which each event may be offered, rising; an event is offered behind those before
    it. ``ready`` has for each clock whether the other end takes an event, repeated.

    Examples
    --------
    Three events at once through two stations: two clocks on their way, then one in every clock.

    >>> [column.tolist() for column in relay(np.zeros(3, np.int64), np.ones(1, np.uint8), 10, 2)]
    [[0, 1, 2], [2, 3, 4]]
    """
    line = np.zeros((stations, 4), np.uint64)
    taken: list[int] = []
    left: list[int] = []
    for t in range(clocks):
        leaves = bool(ready[t % len(ready)]) and offers(line)
        comes = len(taken) < len(offered) and offered[len(taken)] <= t and room(line)
        if leaves:
            left.append(t)
        advance(line, bool(comes), len(taken), leaves)
        if comes:
            taken.append(t)
    return Relayed(np.array(taken[: len(left)], np.int64), np.array(left, np.int64))
