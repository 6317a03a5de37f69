"""The order of events: rows round robin, the requests of a row latched at once, rising columns.

The rows and the columns of a row are bits of 64-bit words, lowest index in the least significant bit.
"""

from __future__ import annotations

import numpy as np
from numba import njit

ZERO, ONE = np.uint64(0), np.uint64(1)


@njit(cache=True)
def lowest(bits: np.uint64) -> int:
    """Return the index of the lowest set bit of a word that is not 0."""
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
    """Return a word without its lowest set bit."""
    return bits & (bits - ONE)


@njit(cache=True)
def next_row(requests: np.uint64, behind: np.uint64) -> int:
    """Return the row to grant: the first requesting one behind the last granted, else the first of all.

    Parameters
    ----------
    requests : uint64
        Requesting rows, not 0.
    behind : uint64
        Rows behind the one last granted; 0 after reset.
    """
    later = requests & behind
    return lowest(later if later != ZERO else requests)


@njit(cache=True)
def rows_behind(row: int) -> np.uint64:
    """Return the rows with a higher index than ``row``."""
    return ~(((ONE << np.uint64(row)) << ONE) - ONE)
