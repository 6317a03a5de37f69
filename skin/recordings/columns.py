"""Match the columns of recordings by name, and leave out columns that are not taxels."""

import dataclasses
import re
from collections.abc import Iterable, Sequence

import numpy as np

from eskin.base.errors import InputError
from eskin.skin.recordings.options import Preparation
from eskin.skin.recordings.table import Table, rises

_OTHER_NAME = re.compile(
    r"(?:^|[\W_])(prox|temp|humid|batt|label|class|index|frame|sample|trial|speed|velocity|motor)", re.IGNORECASE
)

OTHER_UNIT = 20.0
"""Ratio of a column's low values to the high values of most columns above which the unit differs.

A taxel that alone is touched has low values too, at rest.
"""

SATURATED = 0.5  # part of the samples at the largest number of some bits above which a column is saturated


def match_columns(tables: Iterable[Table], options: Preparation) -> tuple[list[Table], Preparation]:
    """Return recordings with equal column order, and the options adapted to this order.

    The names of the options give the order; without any the first file that has names does. Files without names are
    taken as they are. Raise InputError if a file has other names.
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


def only_taxels(tables: Sequence[Table]) -> tuple[list[Table], tuple[str, ...]]:
    """Return recordings without columns that are not taxels, and a note on each removed column.

    Nothing is left out of a single recording, where recordings have different columns, or where most columns would go.
    """
    names = tables[0].names
    if len(tables) < 2 or any(table.names != names for table in tables):
        return list(tables), ()
    reasons = _reasons(tables)
    kept = [number for number in range(len(names)) if number not in reasons]
    if not reasons or 2 * len(kept) < len(names):
        return list(tables), ()
    chosen = [
        dataclasses.replace(table, values=table.values[:, kept], names=tuple(names[k] for k in kept))
        for table in tables
    ]
    notes = [f"column {names[k]!r} is left out: {reason}" for k, reason in sorted(reasons.items())]
    return chosen, (*notes, "--taxel-columns chooses the columns that are taxels")


def _reasons(tables: Sequence[Table]) -> dict[int, str]:
    """Return a dictionary from the number of each column that is not a taxel to the reason."""
    names, found = tables[0].names, {}
    together = np.concatenate([table.values for table in tables])
    low, high = np.percentile(np.abs(together), [10, 90], axis=0)
    top = together.max(0)
    by_name = {number for number, name in enumerate(names) if _OTHER_NAME.search(name)}
    usual = float(np.median([high[number] for number in range(len(names)) if number not in by_name] or [0.0]))
    for number in range(len(names)):
        column = together[:, number]
        if number in by_name:
            found[number] = "its name is not that of a taxel"
        elif np.ptp(column) == 0:
            found[number] = f"it is {column[0]:g} in all recordings"
        elif _is_full_scale(top[number]) and (part := float((column == top[number]).mean())) > SATURATED:
            found[number] = f"{part:.0%} of its samples are {top[number]:g}, the end of its range"
        elif all(rises(table.values[:, number]) for table in tables):
            found[number] = "it rises from sample to sample, as time or a counter does"
        elif usual and low[number] > OTHER_UNIT * usual:
            found[number] = f"its values are {low[number] / usual:.0f} times those of the others: another unit"
    return found


def _is_full_scale(value: float) -> bool:
    """Return True if a number is 2**n - 1 with n of at least 8, the end of a converter's range."""
    return value >= 255 and float(value + 1).is_integer() and np.log2(value + 1).is_integer()
