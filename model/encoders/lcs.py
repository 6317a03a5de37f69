"""LCS, level-crossing sampling: ON where x - u >= D, OFF where x - u < -D (docs/specification.md, section 2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from eskin.model.encoders.encoder import Constants, Encoder

if TYPE_CHECKING:
    from eskin.model.config import ReadoutConfig


class LcsRule(Constants):
    """Constants of LCS."""


class Lcs(Encoder):
    """Level-crossing sampling."""

    name, title, colour, marker, code = "lcs", "LCS", "#0072b2", "o", 0
    Rule: ClassVar[Any] = LcsRule

    def grid(self, config: ReadoutConfig) -> int:
        """Return D; every event moves the reference by D."""
        return config.step

    def state_dtype(self, config: ReadoutConfig) -> type[np.signedinteger[Any]]:
        """Return int16 if int16 can hold the most events of a tick, else int32."""
        return np.int16 if config.resolution <= 12 else np.int32

    def error_bound(self, config: ReadoutConfig) -> tuple[float, float]:
        """Return -D <= x - u < D."""
        return -config.step, config.step - 1

    def slope_limit(self, config: ReadoutConfig) -> float:
        """Return D times the decisions per tick."""
        return float(config.step * config.decisions_per_tick)

    @staticmethod
    def compare(rule: Any, taxel: Any) -> tuple[bool, bool]:
        """Compare the sample with the thresholds u + D and u - D; only u + D is inclusive."""
        d = taxel.x - taxel.u
        return d >= rule.step, d < -rule.step

    @staticmethod
    def move(rule: Any, taxel: Any, on: bool, off: bool, tick: bool, leaks: bool) -> bool:
        """Move the reference by D at every event."""
        if on:
            taxel.u += rule.step
        elif off:
            taxel.u -= rule.step
        return False

    @staticmethod
    def ticks(rule: Any, x: Any, state: Any, phase: Any, tick: int, counts: Any, late: Any, timed: bool) -> None:
        """Write the event counts of every tick; u is in units of D.

        With y = floor(x / D): ON while y - u >= 1 ends at u = y; OFF while y - u < -1 ends at u = y + 1.
        """
        (u,) = state
        code, word = x.dtype.type, u.dtype.type
        shift, high, low = code(rule.step_log2), word(rule.cap), word(-rule.cap)
        for i in range(x.shape[0]):
            for j in range(x.shape[1]):
                y = word(np.right_shift(x[i, j], shift))
                n = word(min(max(u[j], y), word(y + 1)) - u[j])
                n = min(max(n, low), high)
                u[j] = word(u[j] + n)
                counts[i, j] = n
