"""Model of the row-column arbiter: round robin over rows, with the requests of a row latched together.

The rows and the columns of a row are bits of 64-bit words, lowest index in the least significant bit.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

ZERO, ONE = np.uint64(0), np.uint64(1)

# Words of the arbiter's state: columns in the burst latch, their polarities, the rows behind the latched row, the
# latched row, the columns that were latched, and the rows with a request.
WAITING, SIGNS, BEHIND, ROW, TAKEN, REQUESTS = range(6)


ROW_DTYPE = np.dtype([(name, np.uint64) for name in ("pending", "polarity", "active", "fresh", "again")])
"""A row of taxels, a bit for each column: requests, their polarities, the mask, whose mask ends in this clock, and who
must decide once more; with the analog front end these are the taxels whose ``compare`` is high."""


def new_state() -> NDArray[np.uint64]:
    """Return the state of the arbiter after reset, shape (6,)."""
    return np.zeros(6, np.uint64)


@njit(cache=True)
def lowest(bits: np.uint64) -> int:
    """Return the index of the lowest set bit of a non-zero word."""
    index = 0
    while bits & np.uint64(0xFF) == ZERO:
        bits >>= np.uint64(8)
        index += 8
    while bits & ONE == ZERO:
        bits >>= ONE
        index += 1
    return index


@njit(cache=True)
def without_lowest(bits: np.uint64) -> np.uint64:
    """Return a word with its lowest set bit cleared."""
    return bits & (bits - ONE)


@njit(cache=True)
def next_row(requests: np.uint64, behind: np.uint64) -> int:
    """Return the row to grant next: the first requesting row after the last granted row, cyclically.

    ``requests`` is not 0. ``behind`` are the rows behind the last granted row; 0 after reset.
    """
    later = requests & behind
    return lowest(later if later != ZERO else requests)


@njit(cache=True)
def rows_behind(row: int) -> np.uint64:
    """Return a word with a bit set for every row of a higher index than ``row``."""
    return ~(((ONE << np.uint64(row)) << ONE) - ONE)


@njit(inline="always")
def offers(state: NDArray[np.uint64]) -> bool:
    """Return True if the burst latch offers an event."""
    return state[WAITING] != ZERO


@njit(inline="always")
def idle(state: NDArray[np.uint64]) -> bool:
    """Return True if the latch is empty and no row requests."""
    return state[WAITING] == ZERO and state[REQUESTS] == ZERO


@njit(inline="always")
def request(state: NDArray[np.uint64], row: int) -> None:
    """Set the request of a row."""
    state[REQUESTS] |= ONE << np.uint64(row)


@njit(inline="always")
def withdraw(state: NDArray[np.uint64], row: int) -> None:
    """Clear the request of a row."""
    state[REQUESTS] &= ~(ONE << np.uint64(row))


@njit(cache=True)
def take(state: NDArray[np.uint64], columns: int) -> np.int64:
    """Remove the offered event from the latch and return 2 * taxel + polarity."""
    column = lowest(state[WAITING])
    polarity = np.int64(state[SIGNS] >> np.uint64(column) & ONE)
    state[WAITING] = without_lowest(state[WAITING])
    return 2 * (np.int64(state[ROW]) * columns + column) + polarity


@njit(cache=True)
def grant(state: NDArray[np.uint64], rows: Any) -> int:
    """Latch the requests of the next row if the latch is empty; return the row, or -1 if none is granted."""
    if state[WAITING] != ZERO or state[REQUESTS] == ZERO:
        return -1
    row = next_row(state[REQUESTS], state[BEHIND])
    state[WAITING] = state[TAKEN] = rows[row].pending
    state[SIGNS], state[ROW], state[BEHIND] = rows[row].polarity, np.uint64(row), rows_behind(row)
    rows[row].pending = ZERO
    withdraw(state, row)
    return row
