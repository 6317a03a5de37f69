"""The closing window of CW-LCS: its half-width, and how it closes while no event happens.

Plain Python, which ``eskin.model.encoders.compiled`` compiles.
"""

from __future__ import annotations

from typing import Any

STATE = ("closed", "quiet")
"""Numbers of a taxel's window: closing steps taken, and quiet ticks since the last of them or the last event."""


def half_width(rule: Any, taxel: Any) -> Any:
    """Return the half-width h of a taxel's window in codes: D minus the closing steps taken."""
    return rule.step - taxel.closed * rule.closing_step


def open_fully(taxel: Any) -> None:
    """Open the window of a taxel that raises an event."""
    taxel.closed = 0
    taxel.quiet = 0


def pass_tick(rule: Any, taxel: Any) -> bool:
    """Count a sample tick without an event; return whether the window has closed by a step."""
    taxel.quiet += 1
    if taxel.quiet < rule.window_period:
        return False
    taxel.quiet = 0
    closes = taxel.closed < rule.levels - 1
    taxel.closed += 1 if closes else 0
    return closes
