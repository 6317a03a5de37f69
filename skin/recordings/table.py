"""Read a sensor recording from a table with one row per sample."""

import io
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.skin.recordings.options import Preparation
from eskin.skin.samples import (
    ARRAY_SUFFIXES,
    cells_of,
    check_commas,
    delimiter_of,
    is_number,
    lines_of,
    read_samples,
    reason_of,
)

Values = NDArray[np.float64]
UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # units of time stamps in seconds

_TIME_NAME = re.compile(
    r"^\W*(t|times?|time[ _-]?stamps?|date|datetime|secs?|seconds|millis|micros|ms|us)(?![a-z])", re.IGNORECASE
)
_UNIT = re.compile(r"(?:^|[\s(\[_/])(s|sec|secs|seconds|ms|millis|us|µs|micros|ns)[\s)\]]*$", re.IGNORECASE)
_MISSING = ("", "nan", "na", "n/a", "null", "none", "-")  # words for a cell without a number, in lower case
MOST_MISSING = 0.1  # part of the cells of a column that may hold no number; the samples before and after fill them

SAME_STAMP = 0.01
"""Part of the time stamps that may equal the previous time stamp, for example with a clock of whole milliseconds."""

_UNIT_NAMES = {"sec": "s", "secs": "s", "seconds": "s", "millis": "ms", "µs": "us", "micros": "us"}


@dataclass(frozen=True, eq=False)
class Table:
    """One recording as read from its file."""

    path: Path
    values: Values  # in the unit of the file, shape (ticks, taxels)
    names: tuple[str, ...]  # of the taxels' columns
    codes: bool  # all values are whole numbers without a point
    time_s: Values | None  # time stamps from the first, if a column has them, shape (ticks,)
    rate_hz: float | None  # sampling rate, if the file contains one
    notes: tuple[str, ...]  # interpretation of the file, for the user
    named: bool  # the names are in the file
    filled: int  # cells without a number, filled by linear interpolation
    start_s: float  # first time stamp in seconds; 0 if no column has them


def read_table(path: Path, options: Preparation) -> Table:
    """Return the recording from a .csv, .npy or .npz file.

    Raise InputError if the file cannot be read, is no table of finite numbers, lacks a column that the options name, or
    its time stamps do not rise.
    """
    if path.suffix.lower() == ".csv":
        values, names, codes, filled = _read_csv(path, options)
        rate_hz = None
    elif path.suffix.lower() in ARRAY_SUFFIXES:
        samples = read_samples(path)
        flat = samples.values.reshape(len(samples.values), -1)
        values, codes, rate_hz, filled = flat.astype(float), samples.values.dtype.kind in "iu", samples.rate_hz, 0
        names = _numbered(values)
    else:
        raise InputError(f"{path} is not a table of samples; accepted are {', '.join(ARRAY_SUFFIXES)}")
    time_column, notes = _time_column(path, values, names, options)
    chosen = _chosen_columns(path, names, options.taxel_columns)
    if time_column is not None and options.taxel_columns == "":
        chosen = [number for number in chosen if number != time_column]
    if not chosen:
        raise InputError(f"{path} has only time stamps; add a column for each taxel")
    time_s, start_s = None, 0.0
    if time_column is not None and "counter" not in " ".join(notes):
        time_s, start_s, note = _seconds(path, values[:, time_column], names[time_column], options)
        notes = (*notes, note)
    taxels, named = tuple(names[k] for k in chosen), names != _numbered(values)
    return Table(path, values[:, chosen], taxels, codes, time_s, rate_hz, notes, named, filled, start_s)


# -- text --------------------------------------------------------------------------------------------


def _read_csv(path: Path, options: Preparation) -> tuple[Values, tuple[str, ...], bool, int]:
    """Return values and column names of a table, whether all values are integers, and the number of filled cells."""
    lines = lines_of(path, "save it as comma-separated values in UTF-8")
    if not lines:
        raise InputError(f"{path} holds no samples; give at least one line of numbers")
    delimiter = {"tab": "\t", "space": None, "": delimiter_of(lines)}.get(options.delimiter, options.delimiter)
    if any('"' in line for line in lines):
        rows = cells_of(path, lines, delimiter)
        if delimiter == "," and options.decimal == "auto":
            check_commas(path, rows, "add --decimal comma, or remove the separators of thousands")
        lines = ["\t".join(cells) for cells in rows]
        delimiter = "\t"
    comma = options.decimal == "comma" or (options.decimal == "auto" and delimiter != "," and "," in lines[-1])
    if comma and delimiter == ",":
        raise InputError("a decimal comma needs another delimiter; add --delimiter, such as ';'")
    cells = [cell.strip() for cell in lines[0].split(delimiter)]
    headed = not all(is_number(cell.replace(",", ".") if comma else cell) or _is_missing(cell) for cell in cells)
    body = lines[1:] if headed else lines
    if not body:
        raise InputError(f"{path} holds no samples below its header; give at least one line of numbers")
    numbers = "\n".join(body)
    if comma:
        numbers = numbers.replace(",", ".")
    try:
        values = _numbers(numbers, delimiter)
    except ValueError as error:
        raise InputError(
            f"{path} is not a table of numbers: {reason_of(error)}; set --delimiter and --decimal"
        ) from None
    values, filled = _filled(path, values)
    names = tuple(cells) if headed else _numbered(values)
    if len(names) != values.shape[1]:
        raise InputError(f"{path} names {len(names)} columns, but has {values.shape[1]}; repair its header")
    return values, names, not filled and re.search(r"[.eE]", numbers) is None, filled


def _numbers(text: str, delimiter: str | None) -> Values:
    """Return the numbers in a text, shape (rows, columns), with NaN for cells without a number."""

    def load(**more: Any) -> Values:
        return np.loadtxt(io.StringIO(text), np.float64, delimiter=delimiter, comments=None, ndmin=2, **more)

    try:
        return load()
    except ValueError:
        if delimiter is None or not any(_is_missing(cell) for cell in re.split(f"[{re.escape(delimiter)}\n]", text)):
            raise
    return load(converters=lambda cell: math.nan if _is_missing(cell) else float(cell), encoding="utf-8")


def _numbered(values: Values) -> tuple[str, ...]:
    """Return the names of columns without a header: their numbers from 1."""
    return tuple(str(number) for number in range(1, values.shape[1] + 1))


def _filled(path: Path, values: Values) -> tuple[Values, int]:
    """Return values with NaN filled by interpolation, and the number of filled cells.

    Raise InputError if a value is infinite, or a column has too many without a number.
    """
    holes = np.isnan(values)
    wrong = np.isinf(values) | (holes & (holes.mean(0) > MOST_MISSING))
    if found := np.argwhere(wrong).tolist():
        line, column = found[0]
        most = f" (up to {MOST_MISSING:.0%} of a column may be missing)" if holes[line, column] else ""
        raise InputError(
            f"{path} has {values[line, column]} in sample {line + 1}, column {column + 1}{most}; replace it, or leave "
            f"the column out with --taxel-columns"
        )
    place = np.arange(len(values))
    for number in np.flatnonzero(holes.any(0)):
        here = holes[:, number]
        values[here, number] = np.interp(place[here], place[~here], values[~here, number])
    return values, int(holes.sum())


def _is_missing(cell: str) -> bool:
    return cell.strip().lower() in _MISSING


# -- columns -----------------------------------------------------------------------------------------


def _chosen_columns(path: Path, names: tuple[str, ...], text: str) -> list[int]:
    """Return the columns selected by a list such as ``2-17,20`` or ``s1,s2``; an empty list selects all."""
    if not text:
        return list(range(len(names)))
    chosen: list[int] = []
    for part in (part.strip() for part in text.split(",")):
        ends = re.fullmatch(r"(\d+)-(\d+)", part)
        if part not in names and ends is not None:
            chosen += [_column(path, names, str(n)) for n in range(int(ends[1]), min(int(ends[2]), 10**6) + 1)]
        else:
            chosen.append(_column(path, names, part))
    if twice := [column for column in chosen if chosen.count(column) > 1]:
        raise InputError(f"--taxel-columns {text} has {names[twice[0]]} twice; name every column once")
    return chosen


def _column(path: Path, names: tuple[str, ...], text: str) -> int:
    """Return the index of a column given by name or by number, counted from 1."""
    if text in names:
        return names.index(text)
    if text.isdigit() and 1 <= int(text) <= len(names):
        return int(text) - 1
    raise InputError(f"{path} has no column {text!r}; it has {len(names)}: {', '.join(names[:8])}")


def rises(column: Values) -> bool:
    """Return True if every value of a column is larger than the previous value, as time stamps are."""
    return len(column) > 2 and bool((np.diff(column) > 0).all())


def _time_column(
    path: Path, values: Values, names: tuple[str, ...], options: Preparation
) -> tuple[int | None, tuple[str, ...]]:
    """Return the index of the time or sample counter column, and a note about the column."""
    if options.time_column == "none":
        return None, ()
    if options.time_column:
        return _column(path, names, options.time_column), ()
    named = [number for number, name in enumerate(names) if _TIME_NAME.match(name)]
    rising = [number for number in range(values.shape[1]) if rises(values[:, number])]
    if named:
        return named[0], (f"column {names[named[0]]!r} is used as time stamps, because of its name",)
    if rising[:1] != [0] or len(rising) == values.shape[1]:
        return None, ()
    if (np.diff(values[:, 0]) == 1).all():
        return 0, (f"column {names[0]!r} rises by one per line: ignored as a counter",)
    return 0, (f"column {names[0]!r} rises steadily: used as time stamps; --time-column none makes it a taxel",)


def _seconds(path: Path, stamps: Values, name: str, options: Preparation) -> tuple[Values, float, str]:
    """Return time stamps in seconds from the first, the first in seconds, and a note on unit and rate."""
    steps = np.diff(stamps)
    if len(stamps) < 2:
        raise InputError(f"{path} has only one sample; a recording needs at least two")
    wrong = steps < 0 if (steps == 0).mean() <= SAME_STAMP else steps <= 0
    if wrong.any():
        line = int(np.argmax(wrong)) + 2
        raise InputError(
            f"{path}: the time stamp of sample {line} is not later than the previous time stamp; sort the samples, or "
            f"give --time-column none and --sample-rate HZ"
        )
    step = float(np.median(steps))
    unit: str
    if options.time_unit != "auto":
        unit = options.time_unit
    elif found := _UNIT.search(name):
        unit = _UNIT_NAMES.get(found[1].lower(), found[1].lower())
    elif (steps == 1).all():
        raise InputError(f"{path}: the time stamps rise by one; give their unit with --time-unit s, ms, us or ns")
    else:
        unit = "s" if step < 1 else "ms" if step < 1e3 else "us" if step < 1e6 else "ns"
    seconds = (stamps - stamps[0]) * UNITS_S[unit]
    return seconds, float(stamps[0]) * UNITS_S[unit], f"time stamps are in {unit}"
