"""Leak of N-LCS: its size, and its ticks, staggered over the rows.

Plain Python, which ``eskin.model.encoders.compiled`` compiles.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # a configuration knows its encoder, which may leak
    from eskin.model.config import ReadoutConfig


def decay_phases(config: ReadoutConfig) -> NDArray[np.int64]:
    """Return the phase of every row's decay tick within the leak period: floor(r * P / rows).

    Row r leaks at sample ticks j (counted from 0 after reset) with ``j mod leak_period == phase[r]``, so the rows
    do not fire together (docs/specification.md, section 2, N-LCS).
    """
    return np.arange(config.rows, dtype=np.int64) * config.leak_period // config.rows


def leak_of(u: Any, leak_shift: int) -> Any:
    """Return the leak of a reference, u 2**-k rounded half up (docs/specification.md, section 2, N-LCS)."""
    return (u + (1 << (leak_shift - 1))) >> leak_shift


def is_due(leak_period: int, phase: int, tick: int) -> bool:
    """Return True if a row with the given phase leaks at a sample tick."""
    return tick % leak_period == phase


def leaking(phases: Any, now: int) -> tuple[Any, Any, Any, Any]:
    """Return the range of taxels that leak now: 0, first, end, and the number of all taxels.

    ``phases``, shape (taxels,), rise from row to row, so taxels that leak together are neighbours. The middle numbers
    equal the last if no taxel leaks. Compiled loops over unsigned numbers run on vectors.
    """
    end = len(phases)
    first = int(np.searchsorted(phases, now))
    if first == end or phases[first] != now:
        return np.uint64(0), np.uint64(end), np.uint64(end), np.uint64(end)
    return np.uint64(0), np.uint64(first), np.uint64(np.searchsorted(phases, now + 1)), np.uint64(end)
