"""Cycle-accurate model of the merge of event streams: round robin over the tiles.

The merge takes an offered event while it holds fewer than two. Whether it takes an event therefore depends only on
flops, never on the sink in the same clock.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from eskin.base.files import forget_stale_kernels
from eskin.model import arbiter
from eskin.model.arbiter import next_row, rows_behind

forget_stale_kernels(Path(__file__), [Path(str(arbiter.__file__))])

ONE = np.uint64(1)

# Words of the merge's state: number of held events, the offered event, the event behind it, and the tiles that come
# before all others in the next round.
HELD, OFFERED, SPARE, BEHIND = range(4)


def new_state() -> NDArray[np.uint64]:
    """Return the state of the merge after reset, shape (4,)."""
    return np.zeros(4, np.uint64)


@njit(cache=True)
def chosen(state: NDArray[np.uint64], asking: np.uint64) -> int:
    """Return the tile whose event is taken in this clock, or -1."""
    if state[HELD] > ONE or asking == np.uint64(0):
        return -1
    return next_row(asking, state[BEHIND])


@njit(cache=True)
def advance(state: NDArray[np.uint64], tile: int, event: Any, ready: bool) -> None:
    """Advance the merge by a clock edge, in which it takes an event (a number) of a tile, or none (``tile`` -1).

    ``ready`` is true if the sink takes the offered event.
    """
    if ready and state[HELD] > np.uint64(0):
        state[OFFERED] = state[SPARE]
        state[HELD] -= ONE
    if tile >= 0:
        state[SPARE] = np.uint64(event)
        if state[HELD] == np.uint64(0):
            state[OFFERED] = np.uint64(event)
        state[HELD] += ONE
        state[BEHIND] = rows_behind(tile)


class Merged(NamedTuple):
    """The output events of a merge: clock of the transfer, sending tile, and index of the event within its tile."""

    clock: NDArray[np.int64]
    tile: NDArray[np.int64]
    number: NDArray[np.int64]


def merge(offered: list[NDArray[np.int64]], ready: NDArray[np.uint8], clocks: int) -> Merged:
    """Return the output events of a merge.

    ``offered`` has for each tile the first clock in which each of its events may be offered, rising; events are offered
    in order. ``ready`` is the sink's ready per clock, repeated.

    Examples
    --------
    Three tiles at once, then the first again: one event per clock, each tile in its turn.

    >>> tiles = [np.array([0, 1]), np.array([0]), np.array([0])]
    >>> [column.tolist() for column in merge(tiles, np.ones(1, np.uint8), 10)]
    [[1, 2, 3, 4], [0, 1, 2, 0], [0, 0, 0, 1]]
    """
    tiles, state, found = len(offered), new_state(), []
    taken = [0] * tiles
    for t in range(clocks):
        asking = sum(1 << i for i, clock in enumerate(offered) if taken[i] < len(clock) and clock[taken[i]] <= t)
        takes = bool(ready[t % len(ready)])
        if takes and state[HELD]:
            number, sender = divmod(int(state[OFFERED]), tiles)
            found.append((t, sender, number))
        tile = chosen(state, np.uint64(asking))
        advance(state, tile, taken[tile] * tiles + tile, takes)
        if tile >= 0:
            taken[tile] += 1
    return Merged(*np.array(found, np.int64).reshape(-1, 3).T)
