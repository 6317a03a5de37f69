"""Print tables and sentences from data."""

import json
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from eskin.base.rows import Template, digits
from eskin.skin.figures.readouts import look

ROOT = Path(__file__).parents[2]

Rows = Iterable[Mapping[str, Any] | Sequence[str] | str]
"""Rows of ``table``: mappings, which it formats, or the cells themselves, as a list or between `` | ``."""


@cache
def read(path: str) -> Any:
    """Return the content of a JSON file, by its path from the top of the project; callers do not change it."""
    return json.loads((ROOT / path).read_text())


def only(rows: Iterable[Mapping[str, Any]], /, **values: Any) -> dict[str, Any]:
    """Return the only row with the given values."""
    (found,) = (row for row in rows if all(row[name] == value for name, value in values.items()))
    return dict(found)


SHORT = {
    "%": "{accuracy:100*.1f} % ({low:100*.1f} to {high:100*.1f})",
    "%0": "{accuracy:100*.1f} % ({low:100*.0f} to {high:100*.0f})",
    "+%": "{difference:100*+.1f} ({low:100*+.1f} to {high:100*+.1f})",
    "x": "{median:#3} ({least:#3} to {most:#3})",
}
"""Templates by the format of a value that has these fields: an accuracy or a difference with its interval, a median
with the least and the most."""


class _Cells(Template):
    """Template with values of this project.

    Formats are the names of ``SHORT``; ``E`` the title of a readout; ``p`` a p value, or several; ``r`` a normalised
    data rate. ``{row}`` is the row itself.
    """

    def filled(self, template: str, row: Mapping[str, Any]) -> str:
        return super().filled(template, {"row": row, **row})

    def format_value(self, value: Any, spec: str) -> str:
        if spec in SHORT:
            bounds = (value[key] for key in ("interval", "bootstrap_95") if key in value)
            return self.filled(SHORT[spec], value | dict(zip(("low", "high"), next(bounds, ()), strict=False)))
        if spec == "E":
            return look(value).title
        if spec == "p":
            values = value if isinstance(value, list) else [value]
            return ", ".join(digits(one, 2) if one >= 1e-3 else "< 0.001" for one in values)
        if spec == "r":
            return digits(value, 3 if value > 0.1 else 2)
        return super().format_value(value, spec)


CELLS = _Cells()
filled = CELLS.filled
"""Function that returns a template with ``{name:format}`` replaced by the values of a row."""


def say(template: str, **values: Any) -> None:
    """Print a paragraph with inserted values."""
    print(f"\n{filled(template, values)}\n")


def source(report: Mapping[str, Any], more: str = ": {result}") -> None:
    """Print command, commit and date of a report as the source of a table."""
    print(filled("`{command}`, commit {commit}, {date}" + more + ".\n", report))


def table(head: str | Iterable[str], rows: Rows, cells: str = "") -> None:
    """Print a table.

    ``head``: titles of the columns, as a list or between `` | ``.
    ``cells``: templates of the columns between `` | ``.
    """
    titles = head.split(" | ") if isinstance(head, str) else list(head)
    lines = [titles, ["---"] * len(titles)]
    for row in rows:
        if isinstance(row, Mapping):
            made = CELLS.cells(cells, row)
        else:
            made = row.split(" | ") if isinstance(row, str) else [cell.replace("|", "\\|") for cell in row]
        if len(made) != len(titles):
            raise ValueError(f"{len(titles)} titles, {len(made)} cells: {made}")
        lines.append(made)
    print()
    for line in lines:
        print("|" + "---|" * len(line) if line[0] == "---" else f"| {' | '.join(line)} |")
    print()
