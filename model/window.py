"""The closing window of CW-LCS: its half-width, and its steps while no event occurs.

Plain Python, which ``eskin.model.encoders.compiled`` compiles.
"""

from typing import Any

STATE = ("closed", "quiet")
"""Fields of the window of a taxel: number of closing steps, and quiet ticks since the last step or event."""


def half_width(rule: Any, taxel: Any) -> Any:
    """Return the half-width of a taxel's window in codes."""
    return rule.step - taxel.closed * rule.closing_step


def open_fully(taxel: Any) -> None:
    """Open the window of a taxel fully."""
    taxel.closed = 0
    taxel.quiet = 0


def pass_tick(rule: Any, taxel: Any) -> bool:
    """Count a sample tick without an event; return True if the window has closed by a step."""
    taxel.quiet += 1
    if taxel.quiet < rule.window_period:
        return False
    taxel.quiet = 0
    closes = taxel.closed < (1 << rule.levels_log2) - 1
    taxel.closed += 1 if closes else 0
    return closes
