"""The compiled loops of ``model.taxel``: one pass over all ticks, all taxels side by side.

Samples and counts are (ticks, taxels); the state is (taxels,) and is updated in place. The inner loops have
no branches and stay in the type of the state (a bare Numba expression would widen to 64 bits), so that they
run on vectors. Thresholds are multiples of the encoder's grid g: x >= a g and floor(x / g) >= a are the same.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from model import window
from model.decay import leak_of


class ClosingRule(NamedTuple):
    """CW-LCS: closing steps of 2**closing_step_log2 codes, 2**levels_log2 of them in D, at most cap events a tick."""

    closing_step_log2: int
    levels_log2: int
    window_period: int
    cap: int


class LeakyRule(NamedTuple):
    """N-LCS: D is 2**step_log2 units of 2**-fraction_bits code, at most cap events a tick; phase is (taxels,)."""

    phase: NDArray[np.int32]
    leak_period: int
    leak_shift: int
    fraction_bits: int
    step_log2: int
    cap: int


class TaxelState(NamedTuple):
    """Reference, closing steps taken, and quiet ticks since the last of them; each (taxels,), changed in place.

    All of one type, which holds the difference of two samples in closing steps, and ``window_period``.
    """

    u: NDArray[Any]
    closed: NDArray[np.int32]
    quiet: NDArray[np.int32]


# -- one taxel in one clock --------------------------------------------------------------------------


TAXEL_DTYPE = np.dtype([(name, np.int64) for name in ("x", "u", "closed", "quiet", "given")])
"""Sample, reference (N-LCS: in 2**-F codes), closing steps taken, quiet ticks since the last of them, and what the
comparators find in this clock: -1 where x says it, else 1 for above and 2 for below."""


@njit(inline="always")
def decide(p: Any, taxel: Any, tick: bool, leaks: bool) -> tuple[bool, bool, bool]:
    """Let a taxel decide in one clock; return whether it raises ON, OFF, and whether its thresholds moved without.

    Parameters
    ----------
    p : Parameters
        Of ``model.readout``.
    taxel : record of TAXEL_DTYPE
        Changed in place.
    tick, leaks : bool
        The clock is that of a sample tick, and of a leak of this taxel.
    """
    on, off = steps(p, taxel) if tick or not p.per_sample else (False, False)
    moved = leaks
    if p.leaky:
        leak = leak_of(taxel.u, p.leak_shift) if leaks else 0
        taxel.u += (p.step if on else 0) - leak
    elif on or off:
        h = window.half_width(p, taxel)
        taxel.u += h if on else -h
        window.open_fully(taxel)
    elif tick and p.levels > 1:
        moved = window.pass_tick(p, taxel)
    return on, off, moved


@njit(inline="always")
def steps(p: Any, taxel: Any) -> tuple[bool, bool]:
    """Return whether a taxel makes a step up, and whether one down: none that would leave the scale."""
    d = (taxel.x << p.fraction_bits) - taxel.u
    if p.leaky:
        above = d > p.step if taxel.given < 0 else taxel.given & 1 != 0
        return above and taxel.u + p.step <= p.top, False
    h = window.half_width(p, taxel)
    above, below = d >= h, d < -h
    if taxel.given >= 0:
        above, below = taxel.given & 1 != 0, taxel.given == 2  # where both say so, above counts
    return above and taxel.u + h <= p.top, below and taxel.u - h >= p.bottom


@njit(inline="always")
def reset(p: Any, taxel: Any) -> None:
    """Put a taxel into its reset state; what an analog front end looks at stays."""
    taxel.u = p.reset
    window.open_fully(taxel)
    if p.digital:
        taxel.x = 0


# -- all taxels, tick by tick ------------------------------------------------------------------------


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
def cw_lcs(x: Any, taxels: TaxelState, rule: ClosingRule, counts: Any, late: Any, timed: bool) -> None:
    """CW-LCS; u and half-widths in closing steps.

    An event in the first decision moves u by the half-width and opens the window; others follow as in LCS.
    If the first is quiet the window may close, which the second decision sees; a third finds nothing new.
    """
    u, closed, quiet = taxels
    code, state = x.dtype.type, u.dtype.type
    shift, step_log2, levels = code(rule.closing_step_log2), state(rule.levels_log2), state(1 << rule.levels_log2)
    high, low, period = state(rule.cap - 1), state(1 - rule.cap), state(rule.window_period)
    none, one, minus, never = state(0), state(1), state(-1), state(np.iinfo(u.dtype).max)
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            d = state(state(np.right_shift(x[i, j], shift)) - u[j])
            half, below = state(levels - closed[j]), state(closed[j] - levels)
            move = half if d >= half else none
            move = below if d < below else move
            first = one if move > none else (minus if move < none else none)
            d = state(d - move)
            more = state(np.right_shift(d, step_log2) + (one if d < none else none))  # 0 after a quiet first decision
            more = min(max(more, low), high)
            move = state(move + np.left_shift(more, step_log2))

            ticks = state(quiet[j] + one) if first == none else none
            shut = closed[j] if first == none else none
            half = never
            if ticks == period:
                ticks = none
                shut = min(state(shut + one), state(levels - one))
                half = state(levels - shut) if rule.cap > 1 else never
            below = state(-half)
            again = half if d >= half else none
            again = below if d < below else again
            second = one if again > none else (minus if again < none else none)

            quiet[j] = ticks
            closed[j] = shut if second == none else none
            u[j] = state(u[j] + state(move + again))
            counts[i, j] = state(state(first + more) + second)
            if timed:
                late[i, j] = second != none


@njit(cache=True, nogil=True)
def nlcs(x: Any, u: Any, tick: int, rule: LeakyRule, counts: Any, late: Any, timed: bool) -> None:
    """N-LCS; u and D in units of 2**-F code, ``tick`` since reset.

    The first decision and, where it is due, the leak of the old u; then events while x - u > D, which are
    ceil((x - u) / D) - 1.
    """
    state = u.dtype.type
    fraction, step, step_shift = state(rule.fraction_bits), state(1 << rule.step_log2), state(rule.step_log2)
    high, none = state(rule.cap - 1), state(0)
    for i in range(x.shape[0]):
        now = state((tick + i) % rule.leak_period)
        for j in range(x.shape[1]):
            d = state(np.left_shift(state(x[i, j]), fraction) - u[j])
            first = state(d > step)
            leak = state(leak_of(u[j], rule.leak_shift)) if rule.phase[j] == now else none
            move = state(np.left_shift(first, step_shift) - leak)
            d = state(d - move)
            more = min(max(np.right_shift(state(d - 1), step_shift), none), high)
            u[j] = state(u[j] + state(move + np.left_shift(more, step_shift)))
            counts[i, j] = state(first + more)
            if timed:
                late[i, j] = first == 0 and more > 0


@njit(cache=True, nogil=True)
def bipolar(x: Any, u: Any, rule: LeakyRule, counts: Any) -> None:
    """N-LCS with an OFF side, as proposed in docs/results/classifier.md; u and D in units of 2**-F code.

    As ``nlcs``, but the reference has a sign and leaks towards 0 from both sides: ON while x - u > D, OFF while
    x - u < -D.
    """
    step = np.int64(1) << rule.step_log2
    for i in range(x.shape[0]):
        now = i % rule.leak_period
        for j in range(x.shape[1]):
            d = (np.int64(x[i, j]) << rule.fraction_bits) - u[j]
            first = np.int64(d > step) - np.int64(d < -step)
            move = first * step - (leak_of(np.int64(u[j]), rule.leak_shift) if rule.phase[j] == now else 0)
            d -= move
            more = max((abs(d) - 1) >> rule.step_log2, 0)
            more = min(more, rule.cap - 1) * (1 if d > 0 else -1)
            u[j] += move + more * step
            counts[i, j] = first + more


@njit(cache=True, nogil=True)
def magnitudes(counts: Any) -> Any:
    """Return the sum of |counts| over the ticks, int32 of shape (taxels,), which it must fit."""
    totals = np.zeros(counts.shape[1], np.int32)
    for i in range(counts.shape[0]):
        for j in range(counts.shape[1]):
            totals[j] = np.int32(totals[j] + np.int32(abs(counts[i, j])))
    return totals


@njit(inline="always")
def _up_to(n: Any, room: Any, step: Any) -> Any:
    """Return how many of n steps fit between the reference and the end of the scale."""
    return min(n, max(room, 0) // step)


@njit(cache=True, nogil=True)
def decode_lcs(counts: Any, u: Any, step: int, full_scale: int, reference: Any) -> None:
    """Write the reference in codes at the end of every tick, as ``lcs`` moved it; u is in codes."""
    for i in range(counts.shape[0]):
        for j in range(counts.shape[1]):
            n = np.int64(counts[i, j])
            if n > 0:
                u[j] += _up_to(n, full_scale - 1 - u[j], step) * step
            else:
                u[j] -= _up_to(-n, u[j] + full_scale, step) * step
            reference[i, j] = u[j]


@njit(cache=True, nogil=True)
def decode_cw_lcs(counts: Any, late: Any, u: Any, rule: ClosingRule, full_scale: int, reference: Any) -> None:
    """Write the reference in codes at the end of every tick, as ``cw_lcs`` moved it; u is in codes."""
    closing_step = 1 << rule.closing_step_log2
    step = closing_step << rule.levels_log2
    half = np.full(counts.shape[1], step)
    quiet = np.zeros(counts.shape[1], np.int64)
    for i in range(counts.shape[0]):
        for j in range(counts.shape[1]):
            n = np.int64(counts[i, j])
            if n == 0 or late[i, j]:
                quiet[j] += 1
                if quiet[j] == rule.window_period:
                    quiet[j] = 0
                    half[j] = max(half[j] - closing_step, closing_step)
            if n != 0:
                sign = 1 if n > 0 else -1
                room = full_scale - 1 - u[j] if n > 0 else u[j] + full_scale
                first = _up_to(1, room, half[j]) * half[j]
                u[j] += sign * (first + _up_to(abs(n) - 1, room - first, step) * step)
                half[j] = step
                quiet[j] = 0
            reference[i, j] = u[j]


@njit(cache=True, nogil=True)
def decode_nlcs(counts: Any, u: Any, rule: LeakyRule, full_scale: int, unit: float, reference: Any) -> None:
    """Write the reference in codes at the end of every tick, as ``nlcs`` moved it; u is in ``unit``."""
    step, top = 1 << rule.step_log2, (full_scale << rule.fraction_bits) - 1
    for i in range(counts.shape[0]):
        now = i % rule.leak_period
        for j in range(counts.shape[1]):
            if rule.phase[j] == now:
                u[j] -= leak_of(u[j], rule.leak_shift)
            u[j] += _up_to(np.int64(counts[i, j]), top - u[j], step) * step
            reference[i, j] = u[j] * unit
