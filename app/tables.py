"""Print tables on standard output in one style."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from eskin.app.cli import printable
from eskin.base.rows import Template

if TYPE_CHECKING:
    from rich.table import Table

CELLS = Template("")
filled = CELLS.filled
"""Function that returns a template with ``{name:format}`` replaced by the values of a row."""


def new_table(headings: Iterable[str], title: str = "", left: Iterable[int] = (0,), **columns: Any) -> Table:
    """Return an empty table.

    Headings are literal text: brackets are not markup. ``left`` has the indices of left-aligned columns. ``columns``
    are arguments of rich's ``add_column``.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, title=Text(title, style="table.title") if title else None, title_justify="left")
    at_left = set(left)
    for number, heading in enumerate(headings):
        table.add_column(
            Text(heading), justify="left" if number in at_left else "right", **{"overflow": "fold"} | columns
        )
    return table


def print_table(
    heads: str | Iterable[str],
    rows: Iterable[Mapping[str, Any] | Sequence[str]],
    cells: str = "",
    title: str = "",
    left: Iterable[int] = (0,),
    least_width: int = 0,
) -> None:
    """Print a table.

    Rows are mappings, which the templates ``cells`` format (``eskin.base.rows``), or the cells themselves. In a text
    `` | `` separates headings or templates. Other parameters are those of ``new_table`` and ``show``.
    """
    from rich.text import Text

    table = new_table(heads.split(" | ") if isinstance(heads, str) else heads, title, left)
    for row in rows:
        made = CELLS.cells(cells, row) if isinstance(row, Mapping) else row
        table.add_row(*(Text(printable(cell)) for cell in made))
    show(table, least_width)


def show(table: Table, least_width: int = 0) -> None:
    """Print a table on standard output."""
    from rich.console import Console

    console = Console()
    Console(width=max(console.width, least_width)).print(table)


def print_report(data: Any, as_json: bool, show: Callable[[Any], None]) -> None:
    """Print data as a JSON object, or call the function ``show`` to print tables."""
    if as_json:
        print(json.dumps(data))
    else:
        show(data)


def show_facts(facts: Mapping[str, str]) -> None:
    """Print names and values, one pair per line."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(show_header=False, box=None)
    for name, value in facts.items():
        table.add_row(Text(name), Text(value))
    Console().print(table)
