"""Register settings that change during a simulation of the readout."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model import arbiter, decay
from eskin.model.arbiter import ONE
from eskin.model.config import ReadoutConfig
from eskin.model.registers import pattern

SETTING_DTYPE = np.dtype(
    [
        (name, np.int64)
        for name in (
            *("t", "coarser", "leak_shift", "leak_period", "window_period"),
            *pattern.Pattern._fields,
            *("pattern_restarts", "decay_restarts"),
        )
    ]
)
"""The clock from which settings are valid, and all settings: ``coarser``, the bits by which the resolution is below the
built one, fields of ``ReadoutConfig`` and ``Pattern``, and whether pattern and decay ticks restart in that clock."""

_next = njit(cache=True)(pattern.advance)


def check(config: ReadoutConfig, given: NDArray[np.void]) -> None:
    """Check that settings fit a configuration."""
    if not len(given):
        return
    if config.registers == "none":
        raise InputError("settings need registers; build the readout with registers=spi")
    if given["t"][0] != 0 or (np.diff(given["t"]) < 1).any():
        raise InputError("the clocks of settings must rise from 0")
    if not ((given["coarser"] >= 0) & (given["coarser"] < config.resolution)).all():
        raise InputError(f"a resolution must be in 1..{config.resolution}, the built one")


# Words of the host's state: number of settings so far, whether a test pattern runs, whether the pattern and the decay
# ticks restart in this clock, and the sample tick from which leaks are counted; then the state of the pattern.
NUMBER, TESTING, PATTERN_RESTARTS, DECAY_RESTARTS, FIRST_TICK, PATTERN = range(6)


@njit(cache=True)
def new_host() -> NDArray[np.int64]:
    """Return the state of the settings after reset."""
    return np.array([0, 0, 0, 0, 0, 0, 0, 0, 1, 0])


@njit(inline="always")
def next_change(host: Any, given: Any, clocks: int) -> Any:
    """Return the clock of the next settings, or the end of the run (its number of clocks)."""
    return min(given[host[NUMBER]].t, clocks) if host[NUMBER] < len(given) else clocks


@njit(inline="always")
def apply(host: Any, given: Any, t: int, ticks: int, rows: Any, latch: Any) -> tuple[bool, bool]:
    """Apply the settings of a clock; return whether settings changed, and whether a test pattern runs.

    A restarted pattern withdraws its request.
    """
    host[PATTERN_RESTARTS] = host[DECAY_RESTARTS] = 0
    if host[NUMBER] == len(given) or given[host[NUMBER]].t != t:
        return False, host[TESTING] != 0
    _apply(host, given[host[NUMBER]], ticks, rows, latch)
    return True, host[TESTING] != 0


@njit(cache=True)
def _apply(host: Any, now: Any, ticks: int, rows: Any, latch: Any) -> None:
    host[NUMBER] += 1
    host[TESTING] = now.mode != pattern.OFF
    host[PATTERN_RESTARTS], host[DECAY_RESTARTS] = now.pattern_restarts, now.decay_restarts
    if host[DECAY_RESTARTS]:
        host[FIRST_TICK] = ticks
    tests = host[PATTERN:]
    if host[PATTERN_RESTARTS] and tests[pattern.REQUEST] == 1:
        rows[tests[pattern.ROW]].pending &= ~(ONE << np.uint64(tests[pattern.COLUMN]))
        arbiter.withdraw(latch, tests[pattern.ROW])


@njit(cache=True)
def set_phases(phases: NDArray[np.int64], leak_period: int) -> None:
    """Set the leak phase of every row for a new leak period."""
    for row in range(len(phases)):
        phases[row] = row * leak_period // len(phases)


@njit(inline="always")
def leaks(host: Any, p: Any, phase: Any, ticks: int) -> bool:
    """Return True if a row with the given phase leaks at the latest sample tick."""
    return host[DECAY_RESTARTS] == 0 and decay.is_due(p.rule.leak_period, phase, ticks - 1 - host[FIRST_TICK])


@njit(inline="always")
def advance(host: Any, given: Any, columns: int, granted: int, rows: Any, latch: Any) -> None:
    """Advance a running test pattern by a clock edge."""
    if host[TESTING] or host[PATTERN_RESTARTS]:
        _advance(host, given[host[NUMBER] - 1], columns, granted, rows, latch)


@njit(cache=True)
def _advance(host: Any, now: Any, columns: int, granted: int, rows: Any, latch: Any) -> None:
    tests, restarts = host[PATTERN:], host[PATTERN_RESTARTS] != 0
    taken = not restarts and tests[pattern.REQUEST] == 1 and granted == tests[pattern.ROW]
    _next(tests, now, (len(rows), columns), restarts, taken)
    if tests[pattern.REQUEST] == 1:
        row, bit = tests[pattern.ROW], ONE << np.uint64(tests[pattern.COLUMN])
        rows[row].pending |= bit
        rows[row].polarity = rows[row].polarity | bit if tests[pattern.SIGN] == 1 else rows[row].polarity & ~bit
        arbiter.request(latch, row)
