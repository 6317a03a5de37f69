"""Match the columns of recordings by name, and leave out columns that are not taxels."""

import dataclasses
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.skin.recordings.options import Preparation
from eskin.skin.recordings.table import COUNTER, LABEL, OTHER, Table, counts, read_table, rises

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
    return dataclasses.replace(table, values=table.values[:, order], names=names, shape=None)


def read_one(
    path: Path, options: Preparation, rate_hz: float | None = None, taxels: int | None = None
) -> tuple[Table, tuple[str, ...]]:
    """Return a recording with only its taxels, and notes; the arguments are those of its two steps."""
    table = read_table(path, options, rate_hz)
    if options.taxel_columns:
        return table, table.notes
    (table,), notes = only_taxels([table], taxels)
    return table, (*table.notes, *notes)


def only_taxels(tables: Sequence[Table], taxels: int | None = None) -> tuple[list[Table], tuple[str, ...]]:
    """Return recordings without columns that are not taxels, and a note on each removed column.

    A column of text, dates or nothing always goes. Others that look like no taxel stay in an array whose rows and
    columns the file or the user gives, where recordings have different columns, or where most columns would go.

    ``taxels`` is the number of taxels that the user gave.
    """
    for table in tables:
        if table.doubt and taxels != table.values.shape[1]:
            rows, columns = table.shape or (1, table.values.shape[1])
            raise InputError(
                f"{table.path}: {table.doubt}; otherwise confirm the array with --rows {rows} --columns {columns}"
            )
    names = tables[0].names
    if any(table.names != names for table in tables):
        bad = {name: reason for table in tables for name, reason in table.no_taxels.items()}
        return [_without(table, [n for n in table.names if n not in bad]) for table in tables], _notes(bad)
    sure = {name: reason for table in tables for name, reason in table.no_taxels.items()}
    sure = {names[k]: sure[names[k]] for k in range(len(names)) if names[k] in sure}
    kept = [name for name in names if name not in sure]
    if not kept:
        raise InputError(
            f"{tables[0].path} has no column that is a taxel in all recordings; choose with --taxel-columns"
        )
    tables = [_without(table, kept) for table in tables]
    reasons = _reasons(tables)
    left = len(kept) - len(reasons)
    if tables[0].shape is not None or taxels == len(kept) or 2 * left < len(kept) or not left:
        reasons = {}
    chosen = [name for k, name in enumerate(kept) if k not in reasons]
    doubts = {kept[k]: reason for k, reason in sorted(reasons.items())}
    return [_without(table, chosen) for table in tables], _notes(sure | doubts)


def _notes(reasons: Mapping[str, str]) -> tuple[str, ...]:
    notes = tuple(f"column {name!r} is left out: it {reason}" for name, reason in reasons.items())
    return (*notes, "--taxel-columns chooses the columns that are taxels") if notes else ()


def _without(table: Table, kept: Sequence[str]) -> Table:
    """Return a recording with only the named columns."""
    if len(kept) == len(table.names):
        return table
    places = [k for k, name in enumerate(table.names) if name in set(kept)]
    names = tuple(table.names[k] for k in places)
    return dataclasses.replace(table, values=table.values[:, places], names=names, no_taxels={}, shape=None)


def _reasons(tables: Sequence[Table]) -> dict[int, str]:
    """Return a dictionary from the number of each column that is not a taxel to the reason."""
    names, found = tables[0].names, {}
    together = np.concatenate([table.values for table in tables])
    low, high = np.percentile(np.abs(together), [10, 90], axis=0)
    top = together.max(0)
    by_name = {k for k, name in enumerate(names) if tables[0].named and (OTHER.search(name) or LABEL.match(name))}
    usual = float(np.median([high[number] for number in range(len(names)) if number not in by_name] or [0.0]))
    family = _family(names) if tables[0].named else frozenset()
    fractions = [bool((together[:, k] % 1 != 0).any()) for k in range(len(names))]
    for number, name in enumerate(names):
        column = together[:, number]
        if number in by_name:
            found[number] = "has a name that is not that of a taxel"
        elif all(counts(table.values[:, number]) for table in tables):
            found[number] = "counts the samples"
        elif tables[0].named and COUNTER.match(name) and all(_mostly_counts(t.values[:, number]) for t in tables):
            found[number] = "has the name of a counter, and counts"
        elif np.ptp(column) == 0:
            found[number] = f"is {column[0]:g} in {'all recordings' if len(tables) > 1 else 'every sample'}"
        elif (
            set(np.unique(column[:1000]).tolist()) <= {0, 1}
            and set(np.unique(column).tolist()) <= {0, 1}
            and sum(fractions) > 0.5 * len(names)
        ):
            found[number] = "is 0 or 1, as a label is"
        elif _is_full_scale(top[number]) and (part := float((column == top[number]).mean())) > SATURATED:
            found[number] = f"has {part:.0%} of its samples at {top[number]:g}, the end of its range"
        elif all(rises(table.values[:, number]) for table in tables) and (
            name not in family or all(_evenly(table.values[:, number]) for table in tables)
        ):
            found[number] = "rises from sample to sample, as time or a counter does"
        elif usual and low[number] > OTHER_UNIT * usual:
            found[number] = f"has values {low[number] / usual:.0f} times those of the others: another unit"
    return found


def _mostly_counts(column: NDArray[np.float64]) -> bool:
    """Return True if most samples are one more than the previous one, as in a counter that starts again."""
    return bool((np.diff(column) == 1).mean() > 0.5) if len(column) > 1 else True


def _evenly(column: NDArray[np.float64]) -> bool:
    """Return True if all steps of a column are equal, as those of a counter are."""
    return bool(np.ptp(np.diff(column)) < 1e-9 * np.abs(column).max())


def _family(names: Sequence[str]) -> frozenset[str]:
    """Return the names that end in a number and share their beginning with most names, as ``T1`` to ``T4`` do."""
    beginnings = {name: name.rstrip("0123456789") for name in names if name[-1:].isdigit()}
    common = Counter(beginnings.values()).most_common(1)
    if not common or common[0][1] < max(0.5 * len(names), 2):
        return frozenset()
    return frozenset(name for name, beginning in beginnings.items() if beginning == common[0][0])


def _is_full_scale(value: float) -> bool:
    """Return True if a number is 2**n - 1 with n of at least 8, the end of a converter's range."""
    return value >= 255 and float(value + 1).is_integer() and np.log2(value + 1).is_integer()
