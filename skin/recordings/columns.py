"""Match the columns of recordings by name."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

from eskin.base.errors import InputError
from eskin.skin.recordings.options import Preparation
from eskin.skin.recordings.table import Table


def match_columns(tables: Iterable[Table], options: Preparation) -> tuple[list[Table], Preparation]:
    """Return recordings with equal column order, and the options adapted to this order.

    Files without names are taken as they are.

    Parameters
    ----------
    tables : iterable of Table
    options : Preparation
        Its names give the order; without any the first file that has names does.

    Raises
    ------
    InputError
        If a file has other names.
    """
    found = []
    for table in tables:
        if not table.named:
            found.append(table)
            continue
        if not options.names:
            options = dataclasses.replace(options, names=table.names)
        if len(table.names) == len(options.names) and table.names != options.names:
            note = "the column order differs between files: columns are matched by name"
            table = dataclasses.replace(_ordered(table, options.names), notes=(*table.notes, note))
        found.append(table)
    return found, options


def _ordered(table: Table, names: tuple[str, ...]) -> Table:
    """Return a recording with its columns in the given order of names."""
    if other := [name for name in table.names if name not in names]:
        raise InputError(
            f"{table.path} has the column {other[0]!r}, the other files {', '.join(names[:8])}; rename it, or choose "
            f"columns that all files have with --taxel-columns"
        )
    if len(set(table.names)) < len(table.names):
        raise InputError(
            f"{table.path} repeats a column name, and other files have another order of columns; rename a column"
        )
    order = [table.names.index(name) for name in names]
    return dataclasses.replace(table, values=table.values[:, order], names=names)
