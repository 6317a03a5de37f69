"""CW-LCS: LCS with a window that closes in steps while no event occurs (docs/specification.md, section 2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from eskin.base.errors import InputError
from eskin.model import window
from eskin.model.encoders.encoder import Constants, Encoder

if TYPE_CHECKING:
    from eskin.model.config import ReadoutConfig


class CwLcsRule(Constants):
    """Constants of CW-LCS."""


class CwLcs(Encoder):
    """Level-crossing sampling with a closing window."""

    name, title, colour, marker, code = "cw-lcs", "CW-LCS", "#cc79a7", "D", 1
    parameters = ("closing_shift", "window_period")
    windowed = timed = True
    Rule = CwLcsRule
    state = window.STATE

    def grid(self, config: ReadoutConfig) -> int:
        """Return the closing step; every half-width is a multiple of the closing step."""
        return config.closing_step

    def check(self, config: ReadoutConfig) -> None:
        """Check that D has enough codes for all closing steps, if the readout has registers.

        Otherwise a coarser D, which a host may set, would have more closing steps than the
        window was built for.
        """
        most = config.sample_bits - 2 - config.resolution
        if config.registers != "none" and config.closing_shift > most:
            raise InputError(
                f"closing_shift must be in 0..{most} = sample_bits - 2 - resolution with registers={config.registers}, "
                f"not {config.closing_shift}; otherwise the window of a coarser resolution does not fit: "
                f"lower closing_shift, or raise sample_bits to {config.resolution + 2 + config.closing_shift}"
            )

    def state_dtype(self, config: ReadoutConfig) -> type[np.signedinteger[Any]]:
        """Return int16 if int16 can hold all sample differences and tick counters, else int32."""
        bits = config.sample_bits - (config.closing_step.bit_length() - 1)
        return np.int16 if bits <= 15 and config.window_period <= np.iinfo(np.int16).max else np.int32

    def half_width(self, config: ReadoutConfig, taxels: Any) -> Any:
        """Return the half-width of the window of every taxel."""
        return config.step - taxels["closed"] * config.closing_step

    def error_bound(self, config: ReadoutConfig) -> tuple[float, float]:
        """Return -D <= x - u < D, or with several decisions per tick -h <= x - u < h for half-width h."""
        return -config.step, config.step - 1

    def slope_limit(self, config: ReadoutConfig) -> float:
        """Return the largest step between two samples, in codes, for which the error bound holds."""
        decisions = config.decisions_per_tick
        closing = config.closing_step if decisions == 1 and config.closing_levels_log2 else 0
        return float(config.step * decisions - closing)

    @staticmethod
    def compare(rule: Any, taxel: Any) -> tuple[bool, bool]:
        """Compare the sample with the window; the upper threshold is inclusive."""
        d, h = taxel.x - taxel.u, window.half_width(rule, taxel)
        return d >= h, d < -h

    @staticmethod
    def reach(rule: Any, taxel: Any) -> Any:
        """Return the half-width."""
        return window.half_width(rule, taxel)

    @staticmethod
    def move(rule: Any, taxel: Any, on: bool, off: bool, tick: bool, leaks: bool) -> bool:
        """Move the reference by the half-width and open the window, or count a tick without an event."""
        if on or off:
            h = window.half_width(rule, taxel)
            taxel.u += h if on else -h
            window.open_fully(taxel)
        elif tick and rule.levels_log2:
            return window.pass_tick(rule, taxel)
        return False

    @staticmethod
    def clear(rule: Any, taxel: Any) -> None:
        """Open the window."""
        window.open_fully(taxel)

    @staticmethod
    def ticks(rule: Any, x: Any, state: Any, phase: Any, tick: int, counts: Any, late: Any, timed: bool) -> None:
        """Write the event counts of every tick; u and half-widths are in closing steps.

        The first decision compares with the half-width. If it is quiet and the window closes, the second decision sees
        the next half-width; a third finds nothing new. An event moves u by the half-width and opens the window; others
        follow as in LCS. For d = x - u, ``a`` is d or -d - 1, whichever is not negative: ON is d >= h, OFF is d < -h,
        and both are a >= h. The loop loads every state and selects afterwards, so that vectors need no masks.
        """
        u, closed, quiet = state
        code, word = x.dtype.type, u.dtype.type
        shift, step_log2 = code(rule.step_log2 - rule.levels_log2), word(rule.levels_log2)
        sign_shift = word(8 * u.itemsize - 1)
        levels, high, period = word(1 << rule.levels_log2), word(rule.cap - 1), word(rule.window_period)
        none, one = word(0), word(1)
        for i in range(x.shape[0]):
            for j in range(x.shape[1]):
                d = word(word(np.right_shift(x[i, j], shift)) - u[j])
                sign = np.right_shift(d, sign_shift)
                a = word(d ^ sign)
                was = closed[j]
                passed = word(quiet[j] + one)
                closes = passed == period
                shut = min(word(was + (one if closes else none)), word(levels - one))
                half = word(levels - was)
                least = word(levels - (shut if high > none else was))
                fires = a >= least
                first = min(a, half)
                more = min(np.right_shift(word(a - first), step_log2), high)
                move = word(first + np.left_shift(more, step_log2)) if fires else none
                n = word(more + one) if fires else none
                quiet[j] = none if fires | closes else passed
                closed[j] = none if fires else shut
                u[j] = word(u[j] + word(word(move ^ sign) - sign))
                counts[i, j] = word(word(n ^ sign) - sign)
                if timed:
                    late[i, j] = fires & (a < half)
