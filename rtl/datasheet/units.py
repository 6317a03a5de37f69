"""Numbers and tables as a page shows them."""

from __future__ import annotations

import math
from collections.abc import Iterable

PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}


def si(value: float, unit: str) -> str:
    """Return a number in a unit with a prefix, to five digits.

    Examples
    --------
    >>> si(781.25e-9, "s"), si(1_280_000, "Hz"), si(0, "W")
    ('781.25 ns', '1.28 MHz', '0 W')
    """
    if not value:
        return f"0 {unit}"
    power = min(max(3 * math.floor(math.log10(abs(value) * (1 + 1e-9)) / 3), -15), 12)
    return f"{value / 10.0**power:.5g} {PREFIXES[power]}{unit}"


def markdown(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """Return a table as lines; a bar within a cell does not end it."""
    head = list(head)
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |" for cells in [head, *map(list, rows)]]
    return [lines[0], "|" + "---|" * len(head), *lines[1:]]
