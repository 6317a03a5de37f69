"""The closing window of CW-LCS: its half-width, and how it narrows while nothing happens."""

from __future__ import annotations

from typing import Any

from numba import njit


@njit(inline="always")
def half_width(p: Any, taxel: Any) -> Any:
    """Return the half-width h of a taxel's window in codes: D, less the closing steps taken (0 but for CW-LCS)."""
    return p.step - taxel.closed * p.closing_step


@njit(inline="always")
def open_fully(taxel: Any) -> None:
    """Open the window of a taxel: it has raised an event, or is in reset."""
    taxel.closed = 0
    taxel.quiet = 0


@njit(inline="always")
def pass_tick(p: Any, taxel: Any) -> bool:
    """Let a sample tick pass without an event; return whether the window has closed by a step."""
    taxel.quiet += 1
    if taxel.quiet < p.window_period:
        return False
    taxel.quiet = 0
    closes = taxel.closed < p.levels - 1
    taxel.closed += 1 if closes else 0
    return closes
