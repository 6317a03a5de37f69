"""A functional coverage point."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

Named = Iterator[tuple[str, str]]
"""Names of points, and their expressions."""


@dataclass(frozen=True)
class Point:
    """A condition that at least one simulation should reach."""

    group: str  # kind of readout, or block
    name: str
    module: str  # module whose names the expression uses
    expression: str  # SystemVerilog, true at a rising edge of the clock where the point is reached

    @property
    def label(self) -> str:
        """Name of the point for Verilator, equal in all designs of a group."""
        return re.sub(r"\W+", "_", f"{self.group} {self.name}")


def points_of(group: str, module: str, *found: Named) -> Iterator[Point]:
    """Yield named expressions over one module as points of a group."""
    for name, expression in itertools.chain(*found):
        yield Point(group, name, module, expression)


def any_of(terms: Iterable[str]) -> str:
    """Return an expression that is true if any of the given expressions is true."""
    return "(" + " || ".join(f"({term})" for term in terms) + ")"


def began(state: str) -> str:
    """Return an expression that is true in the first clock of a reset that interrupts a given state."""
    return f"rst && !$past(rst) && $past({state})"
