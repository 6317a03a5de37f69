"""Cycle-accurate model of the test pattern generator, which replaces the requests of the array.

Plain functions, which the loop of the readout's model compiles.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

OFF, ONE, ALL = range(3)
"""Modes: no pattern, one taxel repeatedly, all taxels in turn."""

REQUEST, ROW, COLUMN, SIGN, COUNT = range(5)
"""Words of the state: a request waits; its taxel and polarity, or those of the next; clocks until the next may rise."""


class Pattern(NamedTuple):
    """The fields of the register ``test``."""

    mode: int = OFF
    on: int = 1
    turns: int = 0
    interval: int = 0
    row: int = 0
    column: int = 0


def new_state() -> list[int]:
    """Return the state after reset, shape (5,)."""
    return [0, 0, 0, 1, 0]


def requests(state: Sequence[int], restart: bool) -> bool:
    """Return True if the test pattern generator requests in this clock."""
    return state[REQUEST] == 1 and not restart


def advance(state: Any, p: Any, shape: Any, restart: bool, taken: bool) -> None:
    """Advance the test pattern generator of an array of ``shape`` (rows, columns) by a clock edge.

    ``restart`` is true after a write to the register ``test``, or if everything is cleared; ``taken`` if the row of the
    request is granted in this clock.
    """
    if restart:
        state[REQUEST] = state[COUNT] = 0
        state[ROW], state[COLUMN], state[SIGN] = p.row, p.column, p.on
        return
    if p.mode == OFF:
        return
    may_rise = state[COUNT] == 0
    if state[COUNT] > 0:
        state[COUNT] -= 1
    if taken:
        state[REQUEST] = 0
        ends = p.mode == ONE
        if p.mode == ALL:
            state[COLUMN] += 1
            if state[COLUMN] == shape[1]:
                state[COLUMN] = 0
                state[ROW] += 1
                if state[ROW] == shape[0]:
                    state[ROW] = 0
                    ends = True
        if ends and p.turns == 1:
            state[SIGN] = 1 - state[SIGN]
    if may_rise and state[REQUEST] == 0:
        state[REQUEST] = 1
        state[COUNT] = (1 << p.interval) - 1
