"""What the tables of all pages share: where data stand, and how a table is written."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"(<!-- table ([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)
ENCODERS = {"lcs": "LCS", "cw-lcs": "CW-LCS", "nlcs": "N-LCS"}

TABLES: dict[str, Callable[[], str]] = {}


def table(build: Callable[[], str]) -> Callable[[], str]:
    """Register a table under the name of its function, with hyphens."""
    TABLES[build.__name__.replace("_", "-")] = build
    return build


def read(path: str) -> Any:
    """Return the content of a JSON file, by its path from the top of the project."""
    return json.loads((ROOT / path).read_text())


def markdown(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table as text."""
    head = list(head)
    lines = ["| " + " | ".join(cells) + " |" for cells in [head, *map(list, rows)]]
    return "\n".join([lines[0], "|" + "---|" * len(head), *lines[1:]]) + "\n"


def digits(value: float, count: int) -> str:
    """Return a number with so many significant digits, and never in powers of ten."""
    text = f"{value:#.{count}g}"
    return (f"{value:.0f}" if "e" in text else text).removesuffix(".")


def percent(points: dict[str, Any]) -> str:
    """Return an accuracy with its 95 % interval over images and seeds, in per cent."""
    low, high = (100 * bound for bound in points["bootstrap_95"])
    return f"{100 * points['accuracy']:.1f} % ({low:.1f} to {high:.1f})"


def filled(text: str) -> str:
    """Return a document with every table made anew."""
    return BLOCK.sub(lambda found: f"{found[1]}\n{TABLES[found[2]]()}\n{found[3]}", text)
