"""A functional coverage point, and the table of points that do not depend on the sizes of a design."""

import itertools
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Named = Iterator[tuple[str, str]]
"""Names of points, and their expressions."""

TABLES: dict[str, dict[str, str]] = tomllib.loads(Path(__file__).with_name("points.toml").read_text())


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


def table(section: str, of: Callable[[str], str] = str, /, **values: Any) -> Named:
    """Yield the points of a section of ``points.toml``; ``of`` returns the whole expression of a design."""
    for name, expression in TABLES[section].items():
        whole = of(expression.format(**values))
        yield name.format(**values), began(whole) if name.startswith("reset ") else whole


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
