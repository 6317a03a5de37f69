"""Cycle-accurate model of the four-phase AER link with an asynchronous receiver."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

ACK_QUANTA = 8
"""Time quanta per clock, the unit of the delays of an asynchronous receiver."""

# Words of the link's state: its four flops, the level of ACK, the clock at which ACK changes (-1: settled), and
# the number of edges of REQ so far.
SETUP, REQ, ACK_META, ACK_SYNC, ACK, ACK_AT, EDGES = range(7)


def new_state() -> NDArray[np.int64]:
    """Return the state of the link after reset, shape (7,)."""
    state = np.zeros(7, np.int64)
    state[ACK_AT] = -1
    state[ACK_META] = state[ACK_SYNC] = 1  # ACK counts as high until it has been seen low
    return state


@njit(cache=True)
def ready(state: NDArray[np.int64]) -> bool:
    """Return True if the link accepts an event in this clock."""
    return state[SETUP] == 0 and state[REQ] == 0 and state[ACK_SYNC] == 0


@njit(cache=True)
def advance(state: NDArray[np.int64], clock: int, taken: bool, ack_delay: NDArray[np.int64]) -> bool:
    """Advance the link by a clock edge; return True if REQ rises.

    ``taken`` is true if an event is taken in this clock. ``ack_delay`` are the delays from each edge of REQ to the edge
    of ACK in 1/8 clock, used cyclically; never a multiple of 8, so ACK does not change at a clock edge.
    """
    if state[ACK_AT] == clock:
        state[ACK] = state[REQ]
        state[ACK_AT] = -1
    before = state[REQ]
    if state[SETUP] == 1:
        state[REQ] = 1
    elif state[ACK_SYNC] == 1:
        state[REQ] = 0
    state[SETUP] = 1 if taken else 0
    state[ACK_SYNC] = state[ACK_META]
    state[ACK_META] = state[ACK]
    if state[REQ] != before:
        delay = ack_delay[state[EDGES] % ack_delay.size]
        state[ACK_AT] = clock + (delay + ACK_QUANTA - 1) // ACK_QUANTA
        state[EDGES] += 1
    return state[REQ] > before
