"""Read one recording: choose the columns of its file, then turn them into numbers."""

from __future__ import annotations

import csv
import dataclasses
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.skin.readers.frame import Frame
from eskin.skin.readers.registry import Source, read_frame
from eskin.skin.readers.text import MISSING, Layout
from eskin.skin.recordings import stamps
from eskin.skin.recordings.options import Preparation

Values = NDArray[np.float64]

MAX_MISSING = 0.1
"""Part of the cells of a column that may hold no number; the samples before and after fill them."""

LABEL = re.compile(
    r"^\W*(labels?|class(es)?|targets?|y_?true|ground_?truth|category|state|slip(ping)?|contact_?state)\W*$", re.I
)
COUNTER = re.compile(
    r"^\W*(index|idx|frames?|frame_?(no|nr|num(ber)?|id|index)|samples?|seq(uence)?|counter|row|no|nr|n|unnamed.*|)\W*$",
    re.I,
)
OTHER = re.compile(
    r"(?:^|[\W_])(prox|temp|humid|batt|labels?(?![a-z])|class(?![a-z])|trial|speed|velocity|motor|subject|participant|session"
    r"|gesture|variant|pose|quat|orientation|joint|gripper|tcp|robot)",
    re.IGNORECASE,
)
"""Names of columns that are no taxels."""

TRIAL = re.compile(
    r"(?:^|[\W_])(trial|subject|participant|user|session|variant|gesture|run|rep(etition)?|recording|take|object)(?![a-z])",
    re.IGNORECASE,
)
"""Names of columns whose change begins another recording."""


@dataclass(frozen=True, eq=False)
class Table:
    """One recording as read from its file."""

    path: Path
    values: Values  # in the unit of the file, shape (ticks, columns); NaN where a column is no number
    names: tuple[str, ...]  # of these columns
    codes: bool  # all values are whole numbers without a point
    time_s: Values | None  # time stamps from the first, if a column has them, shape (ticks,)
    rate_hz: float | None  # sampling rate, if the file contains one
    notes: tuple[str, ...]  # interpretation of the file, for the user
    named: bool  # the names are in the file
    filled: int  # cells without a number, filled by linear interpolation
    start_s: float  # first time stamp in seconds; 0 if no column has them
    no_taxels: dict[str, str] = field(default_factory=dict)  # reason for each of the columns that cannot be a taxel
    shape: tuple[int, int] | None = None  # rows and columns of the array, if the file has this geometry
    doubt: str = ""  # why its first axis may not be time
    labels: NDArray[Any] | None = None  # text of each sample's label, shape (ticks,)
    groups: NDArray[Any] | None = None  # text of each sample's group, shape (ticks,)
    runs: NDArray[np.int64] | None = None  # number of each sample's trial, which changes with any column that names it


def read_table(path: Path, options: Preparation, rate_hz: float | None = None, needs_labels: bool = True) -> Table:
    """Return the recording in a file of any kind of ``skin/readers``.

    Columns are chosen first and converted then, so that a column of text, dates or nothing never blocks the others.
    Without ``taxel_columns`` the columns that cannot be taxels stay in the table, each with its reason, since other
    recordings of a set may have them too; ``columns.only_taxels`` takes them out.

    ``rate_hz`` is the rate that the user gave; it tells the unit of bare time stamps. Without ``needs_labels``, the
    columns of labels and groups may be missing.

    Raise InputError if the file cannot be read, lacks a column that the options name, a chosen column holds no numbers,
    or its time stamps do not rise.
    """
    layout = Layout(options.delimiter, options.decimal, options.skip_lines, options.frame_lines)
    frame = read_frame(path, Source(layout, options.topic, options.field))
    time, time_notes = _time_column(path, frame, options)
    named = [name for name in (options.label_column, options.group_column) if name]
    if not needs_labels and any(name not in frame.names and not name.isdigit() for name in named):
        named, options = [], dataclasses.replace(options, label_column="", group_column="")
    labels, groups = (_text(path, frame, name) for name in (options.label_column, options.group_column))
    special = {_column(path, frame.names, name) for name in named}
    special |= {time} if time is not None else set()
    chosen = chosen_columns(path, frame.names, options.taxel_columns)
    no_taxels: dict[str, str] = {}
    if not options.taxel_columns:
        chosen = [k for k in chosen if k not in special]
        if not options.time_column or options.time_column == "none":
            other_times = [k for k in chosen if _is_time(frame, k)]
            chosen = [k for k in chosen if k not in other_times]
            time_notes += tuple(
                f"column {frame.names[k]!r} is left out: it is a time; --taxel-columns chooses the taxels"
                for k in other_times
            )
    converted = [_numbers(path, frame, k) for k in chosen]
    for k, (values, reason) in zip(chosen, converted, strict=True):
        if reason and options.taxel_columns:
            raise InputError(f"{path}: column {frame.names[k]!r} {reason}; choose columns of numbers")
        if reason or np.isnan(values).all():
            no_taxels[frame.names[k]] = reason or "has no value"
    if not chosen:
        raise InputError(f"{path} has only time stamps; add a column for each taxel")
    if not [k for k in chosen if frame.names[k] not in no_taxels]:
        raise InputError(f"{path} has no column of samples, only {_listed(frame.names)}; add a column for each taxel")
    values = np.column_stack([values for values, _ in converted])
    values, filled = _filled(path, values, [frame.names[k] for k in chosen], no_taxels)
    codes = all(frame.cells[k].dtype.kind in "iu" for k in chosen if frame.names[k] not in no_taxels) and not filled
    time_s, start_s, notes = None, 0.0, (*frame.notes, *time_notes)
    if time is not None and options.time_column != "none":
        time_s, start_s, notes = _seconds(path, frame, time, options, rate_hz, notes)
    shape = frame.shape if len(chosen) == len(frame.names) - len(special) else None
    return Table(
        path=path,
        values=values,
        names=tuple(frame.names[k] for k in chosen),
        codes=codes,
        time_s=time_s,
        rate_hz=frame.rate_hz,
        notes=notes,
        named=frame.named,
        filled=filled,
        start_s=start_s,
        no_taxels=no_taxels,
        shape=shape,
        doubt=frame.doubt,
        labels=labels,
        groups=groups,
        runs=_trials(path, frame) if options.splits else None,
    )


# -- columns -----------------------------------------------------------------------------------------


def chosen_columns(path: Path, names: tuple[str, ...], text: str) -> list[int]:
    """Return the columns selected by a list such as ``2-17,20`` or ``s1,"a, left"``; an empty list selects all."""
    if not text:
        return list(range(len(names)))
    chosen: list[int] = []
    for part in (part.strip() for part in next(csv.reader([text], skipinitialspace=True))):
        ends = re.fullmatch(r"(\d+)-(\d+)", part)
        if part not in names and ends is not None:
            chosen += [_column(path, names, str(n)) for n in range(int(ends[1]), min(int(ends[2]), 10**6) + 1)]
        else:
            chosen.append(_column(path, names, part))
    if twice := [column for column in chosen if chosen.count(column) > 1]:
        raise InputError(f"--taxel-columns {text} has {names[twice[0]]} twice; name every column once")
    if not chosen:
        raise InputError(f"--taxel-columns {text} chooses no column; name at least one")
    return chosen


def text_of(names: tuple[str, ...]) -> str:
    """Return the text that ``chosen_columns`` reads as these names."""
    return ",".join(f'"{name}"' if "," in name else name for name in names)


def _column(path: Path, names: tuple[str, ...], text: str) -> int:
    """Return the index of a column given by name or by number, counted from 1."""
    if text in names:
        return names.index(text)
    if text.isdigit() and 1 <= int(text) <= len(names):
        return int(text) - 1
    raise InputError(f"{path} has no column {text!r}; it has {len(names)}: {_listed(names)}")


def _listed(names: tuple[str, ...]) -> str:
    return ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")


def _text(path: Path, frame: Frame, name: str) -> NDArray[Any] | None:
    """Return the cells of a column as text; empty for a cell without a value. None without a name."""
    if not name:
        return None
    cells = frame.cells[_column(path, frame.names, name)]
    if cells.dtype.kind == "f" and (cells.dropna() % 1 == 0).all():
        cells = cells.astype("Int64")
    return np.array(["" if missing else str(cell).strip() for cell, missing in zip(cells, cells.isna(), strict=True)])


def _trials(path: Path, frame: Frame) -> NDArray[np.int64]:
    """Return the number of each sample's trial, which changes with subject, trial and the like, or at a restart."""
    changes = np.zeros(len(frame.cells), bool)
    for k, name in enumerate(frame.names):
        if frame.named and TRIAL.search(name):
            text = _text(path, frame, name)
            changes[1:] |= text[1:] != text[:-1] if text is not None else False
        elif frame.named and COUNTER.match(name) and frame.cells[k].dtype.kind in "iu":
            steps = np.diff(stamps.unwrapped(frame.cells[k].to_numpy())[0])
            changes[1:] |= (steps < 0) & (steps > -(2**15))
    return np.cumsum(changes)


def _numbers(path: Path, frame: Frame, k: int) -> tuple[Values, str]:
    """Return the numbers in a column, NaN for cells without one, and a reason why it cannot be a taxel.

    Raise InputError if the column holds numbers, and a cell that is none.
    """
    import pandas

    cells = frame.cells[k]
    nothing = np.full(len(cells), np.nan)
    if pandas.api.types.is_datetime64_any_dtype(cells):
        return nothing, "holds dates"
    if cells.dtype.kind == "b":
        return nothing, "holds truth values"
    if cells.dtype.kind in "iuf":
        return np.asarray(cells.to_numpy(np.float64)), ""
    numbers = pandas.to_numeric(cells, errors="coerce").to_numpy(np.float64)
    text = [at for at in np.flatnonzero(np.isnan(numbers)) if str(cells.iloc[at]).strip().lower() not in MISSING]
    if not text:
        return np.asarray(numbers), ""
    wrong = f"{path} has {str(cells.iloc[text[0]])!r} in sample {text[0] + 1}, column {frame.names[k]!r}"
    if len(text) <= 0.5 * len(cells):
        raise InputError(f"{wrong}, which is no number; repair it, or leave the column out with --taxel-columns")
    return nothing, f"holds text, {str(cells.iloc[text[0]])!r}"


def _filled(path: Path, values: Values, names: list[str], no_taxels: Mapping[str, str]) -> tuple[Values, int]:
    """Return values with NaN filled by interpolation, and the number of filled cells.

    Raise InputError if a column that may be a taxel has an infinite value, or too many cells without a number.
    """
    holes, place = np.isnan(values), np.arange(len(values))
    holes[:, [k for k, name in enumerate(names) if name in no_taxels]] = False
    wrong = np.isinf(values) | (holes & (holes.mean(0) > MAX_MISSING))
    if found := np.argwhere(wrong).tolist():
        line, k = found[0]
        most = f" (up to {MAX_MISSING:.0%} of a column may be missing)" if holes[line, k] else ""
        raise InputError(
            f"{path} has {values[line, k]} in sample {line + 1}, column {names[k]!r}{most}; replace it, or leave the "
            f"column out with --taxel-columns"
        )
    for k in np.flatnonzero(holes.any(0)).tolist():
        here = holes[:, k]
        values[here, k] = np.interp(place[here], place[~here], values[~here, k])
    return values, int(holes.sum())


# -- time --------------------------------------------------------------------------------------------


def rises(column: NDArray[Any]) -> bool:
    """Return True if every value of a column is larger than the previous value, as time stamps are."""
    return len(column) > 2 and bool((np.diff(column) > 0).all())


def counts(column: NDArray[Any]) -> bool:
    """Return True if a column counts lines: it rises by one, also from a counter that starts again."""
    if len(column) < 3 or not np.isfinite(column).all() or not (column == np.rint(column)).all():
        return False
    plain, _ = stamps.unwrapped(column)
    steps = np.diff(plain)
    return bool((steps == 1).all())


def _is_time(frame: Frame, k: int) -> bool:
    """Return True if a column holds dates, or has the name of a time."""
    cells = frame.cells[k]
    if cells.dtype.kind in "iuf":
        return frame.named and stamps.NAME.search(frame.names[k]) is not None
    return cells.dtype.kind != "b" and stamps.dates_of(cells) is not None


def _time_column(path: Path, frame: Frame, options: Preparation) -> tuple[int | None, tuple[str, ...]]:
    """Return the index of the column of time stamps, and a note about it."""
    if options.time_column == "none":
        k = _unnamed_clock(frame)
        left = "is left out: it rises steadily, as time or a counter does; --taxel-columns chooses the taxels"
        return k, (f"column {frame.names[k]!r} {left}",) if k is not None and not options.taxel_columns else ()
    if options.time_column:
        return _column(path, frame.names, options.time_column), ()
    change = "--time-column chooses another, or none"
    times = [k for k in range(len(frame.names)) if _is_time(frame, k)]
    whole = [k for k in times if not frame.cells[k].isna().any()]
    if whole:
        k = whole[0]
        reason = "because of its name" if frame.named and stamps.NAME.search(frame.names[k]) else "since it holds dates"
        return k, (f"column {frame.names[k]!r} is used as time stamps, {reason}; {change}",)
    k = _unnamed_clock(frame)
    if k is None or counts(np.asarray(frame.cells[k].to_numpy(np.float64))):
        return None, ()
    return k, (f"column {frame.names[k]!r} rises steadily: used as time stamps; {change}",)


def _unnamed_clock(frame: Frame) -> int | None:
    """Return the index of the first column of a table without names if it alone rises from sample to sample."""
    if frame.shape is not None or (frame.named and not COUNTER.match(frame.names[0])):
        return None
    rising = [
        k for k in range(len(frame.names)) if frame.cells[k].dtype.kind in "iuf" and rises(frame.cells[k].to_numpy())
    ]
    return 0 if rising[:1] == [0] and len(rising) < len(frame.names) else None


def _seconds(
    path: Path, frame: Frame, k: int, options: Preparation, rate_hz: float | None, notes: tuple[str, ...]
) -> tuple[Values, float, tuple[str, ...]]:
    cells, name = frame.cells[k], frame.names[k]
    if cells.dtype.kind in "iuf":
        column = cells.to_numpy()
        if np.isnan(column.astype(np.float64)).any():
            line = int(np.argmax(np.isnan(column.astype(np.float64)))) + 1
            raise InputError(f"{path}: sample {line} has no time stamp; give --time-column none and --sample-rate HZ")
        if column.dtype.kind == "u" and len(column) and int(column.max()) > 2**63 - 1:
            raise InputError(f"{path}: the time stamp {int(column.max())} is beyond 63 bits; correct column {name!r}")
        if column.dtype.kind == "u":
            column = column.astype(np.int64)
        time_s, start_s, more = stamps.seconds_of(path, column, name, options, rate_hz)
        return time_s, start_s, (*notes, *more)
    dates = stamps.dates_of(cells)
    if dates is None:
        raise InputError(
            f"{path}: column {name!r} holds no time stamps, {str(cells.iloc[0])!r}; choose another --time-column"
        )
    in_ns = Preparation(time_unit="ns")
    time_s, start_s, more = stamps.seconds_of(path, dates, name, in_ns, rate_hz)
    return time_s, start_s, (*notes, *(note for note in more if "are in ns" not in note))
