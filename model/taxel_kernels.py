"""The compiled loops of ``model.taxel``: one pass over all ticks, all taxels side by side.

Samples and counts are (ticks, taxels); the state is (taxels,) and is updated in place. The inner loops have
no branches and stay in the type of the state (a bare Numba expression would widen to 64 bits), so that they
run on vectors. Thresholds are multiples of the encoder's grid g: x >= a g and floor(x / g) >= a are the same.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def leak_of(u: Any, leak_shift: int) -> Any:
    """Return the leak of a reference, u 2**-k rounded half up (docs/specification.md, section 2, N-LCS)."""
    return (u + (1 << (leak_shift - 1))) >> leak_shift


@njit(cache=True, nogil=True)
def magnitude_bits(x: Any) -> Any:
    """Return the OR over the 1-D array of x, or -x - 1 where negative: below 2**(W-1) if all x fit W bits."""
    code = x.dtype.type
    sign = code(8 * x.itemsize - 1)
    seen = code(0)
    for i in range(x.size):
        seen = code(seen | code(x[i] ^ np.right_shift(x[i], sign)))
    return seen


@njit(cache=True, nogil=True)
def lcs(x: Any, u: Any, step_log2: int, cap: int, counts: Any) -> None:
    """LCS, at most cap events a tick; u in steps D.

    With y = floor(x / D): ON while y - u >= 1 ends at u = y; OFF while y - u < -1 ends at u = y + 1.
    """
    code, state = x.dtype.type, u.dtype.type
    shift, high, low = code(step_log2), state(cap), state(-cap)
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            y = state(np.right_shift(x[i, j], shift))
            n = state(min(max(u[j], y), state(y + 1)) - u[j])
            n = min(max(n, low), high)
            u[j] = state(u[j] + n)
            counts[i, j] = n


@njit(cache=True, nogil=True)
def cw_lcs(
    x: Any,
    u: Any,
    closed: Any,
    quiet: Any,
    closing_step_log2: int,
    levels_log2: int,
    window_period: int,
    cap: int,
    counts: Any,
    late: Any,
    timed: bool,
) -> None:
    """CW-LCS, at most cap events a tick; u and half-widths in closing steps, D = 2**levels_log2.

    An event in the first decision moves u by the half-width and opens the window; others follow as in LCS.
    If the first is quiet the window may close, which the second decision sees; a third finds nothing new.
    """
    state = u.dtype.type
    shift, step_log2, levels = state(closing_step_log2), state(levels_log2), state(1 << levels_log2)
    high, low, none = state(cap - 1), state(1 - cap), state(0)
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            d = state(np.right_shift(state(x[i, j]), shift) - u[j])
            half = state(levels - closed[j])
            first = state(state(d >= half) - state(d < state(-half)))
            move = half if first > 0 else (state(-half) if first < 0 else none)
            d = state(d - move)
            more = state(np.right_shift(d, step_log2) + state(d < 0))  # 0 after a quiet first decision
            more = min(max(more, low), high)
            move = state(move + np.left_shift(more, step_log2))

            ticks = none if first != 0 else state(quiet[j] + 1)
            closes = ticks == window_period
            shut = none if first != 0 else state(closed[j] + state(closes and half > 1))
            half = state(levels - shut)
            second = state(state(d >= half) - state(d < state(-half))) if closes and cap > 1 else none
            move = state(move + (half if second > 0 else (state(-half) if second < 0 else none)))

            quiet[j] = none if closes else ticks
            closed[j] = none if second != 0 else shut
            u[j] = state(u[j] + move)
            counts[i, j] = state(state(first + more) + second)
            if timed:
                late[i, j] = second != 0


@njit(cache=True, nogil=True)
def nlcs(
    x: Any,
    u: Any,
    phase: Any,
    tick: int,
    leak_period: int,
    leak_shift: int,
    fraction_bits: int,
    step_log2: int,
    cap: int,
    counts: Any,
    late: Any,
    timed: bool,
) -> None:
    """N-LCS, at most cap events a tick; u and D = 2**step_log2 in units of 2**-F code, ``tick`` since reset.

    The first decision and, where it is due, the leak of the old u; then events while x - u > D, which are
    ceil((x - u) / D) - 1.
    """
    state = u.dtype.type
    fraction, step, step_shift = state(fraction_bits), state(1 << step_log2), state(step_log2)
    high, none = state(cap - 1), state(0)
    for i in range(x.shape[0]):
        now = state((tick + i) % leak_period)
        for j in range(x.shape[1]):
            d = state(np.left_shift(state(x[i, j]), fraction) - u[j])
            first = state(d > step)
            leak = state(leak_of(u[j], leak_shift)) if phase[j] == now else none
            move = state(np.left_shift(first, step_shift) - leak)
            d = state(d - move)
            more = min(max(np.right_shift(state(d - 1), step_shift), none), high)
            u[j] = state(u[j] + state(move + np.left_shift(more, step_shift)))
            counts[i, j] = state(first + more)
            if timed:
                late[i, j] = first == 0 and more > 0


@njit(cache=True, nogil=True)
def magnitudes(counts: Any) -> Any:
    """Return the sum of |counts| over the ticks, int32 of shape (taxels,), which it must fit."""
    totals = np.zeros(counts.shape[1], np.int32)
    for i in range(counts.shape[0]):
        for j in range(counts.shape[1]):
            totals[j] = np.int32(totals[j] + np.int32(abs(counts[i, j])))
    return totals


@njit(cache=True, nogil=True)
def decode_cw_lcs(
    counts: Any, late: Any, u: Any, step: int, closing_step: int, window_period: int, reference: Any
) -> None:
    """Write the reference in codes at the end of every tick, as ``cw_lcs`` moved it; u is in codes."""
    half = np.full(counts.shape[1], step)
    quiet = np.zeros(counts.shape[1], np.int64)
    for i in range(counts.shape[0]):
        for j in range(counts.shape[1]):
            n = np.int64(counts[i, j])
            if n == 0 or late[i, j]:
                quiet[j] += 1
                if quiet[j] == window_period:
                    quiet[j] = 0
                    half[j] = max(half[j] - closing_step, closing_step)
            if n != 0:
                sign = 1 if n > 0 else -1
                u[j] += sign * half[j] + (n - sign) * step
                half[j] = step
                quiet[j] = 0
            reference[i, j] = u[j]


@njit(cache=True, nogil=True)
def decode_nlcs(
    counts: Any, u: Any, phase: Any, leak_period: int, leak_shift: int, step: int, unit: float, reference: Any
) -> None:
    """Write the reference in codes at the end of every tick, as ``nlcs`` moved it; u is in ``unit``."""
    for i in range(counts.shape[0]):
        now = i % leak_period
        for j in range(counts.shape[1]):
            if phase[j] == now:
                u[j] -= leak_of(u[j], leak_shift)
            u[j] += counts[i, j] * step
            reference[i, j] = u[j] * unit
