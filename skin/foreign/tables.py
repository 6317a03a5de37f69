"""Read and write events as tables or arrays with columns t, x, y, p (.csv, .txt, .npy, .npz)."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.files import atomic_write
from eskin.model.events.recording import Recording
from eskin.skin.foreign.events import ForeignEvents, in_unit, lost_clocks
from eskin.skin.readers.text import COMMENT, Layout, decoded, delimiter_of, read_text, split
from eskin.skin.samples import arrays_in, content_of

TEXT_SUFFIXES = (".csv", ".txt", ".tsv")

NAMES = {
    "t": ("t", "time", "ts", "timestamp", "timestamps", "times"),
    "x": ("x", "column", "col"),
    "y": ("y", "row"),
    "p": ("p", "pol", "polarity", "polarities", "on"),
    "address": ("address", "addr", "taxel", "channel", "neuron", "id"),
}
"""Names of columns; the name of the time may end in a unit, as in ``t_us`` or ``time [ms]``."""

REMEDY = "separate the cells of each line by commas"
COMMA_REMEDY = "write a decimal point, and no separators of thousands"

_UNIT = re.compile(r"^(.*?)[\s_\[(]+(s|ms|us|µs|ns|clocks)[\])]?$")


def read_events_table(path: Path, fields: Sequence[str] = (), unit: str | None = None) -> ForeignEvents:
    """Return the events from a table or an array file.

    Raise InputError if the file cannot be read, a column is missing or doubtful, or a cell is no number.

    - ``path``: text with a line for each event, a structured or two-dimensional .npy, or a .npz with one array a
      column.
    - ``fields``: meaning of each column, if the file has no names: t, x, y, p, address, or - for others.
    - ``unit``: unit of the time; by default from the column's name, else s for decimal times and us for integers.
    """
    size = None
    if path.suffix.lower() in TEXT_SUFFIXES:
        columns, size = _text_columns(path)
    else:
        columns = _array_columns(path)
    columns, named_unit = _named(path, columns, fields)
    for name in ("t", "p"):
        if name in columns and columns[name].dtype.kind not in "iufb":
            raise InputError(f"{path}: column {name} has values of type {columns[name].dtype}, not numbers")
    if "t" not in columns:
        raise InputError(f"{path} has no column of times; name the columns with --fields, such as --fields x,y,t,p")
    time = columns["t"]
    if time.dtype.kind == "u" and len(time) and int(time.max()) >= 2**63:
        raise InputError(f"{path}: the time {int(time.max())} is beyond 63 bits; correct the column of times")
    time = time.astype(np.int64) if time.dtype.kind in "iub" else time.astype(np.float64)
    notes = []
    chosen = unit or named_unit
    if chosen is None:
        chosen = "us" if time.dtype.kind == "i" else "s"
        notes.append(f"times were taken as {chosen}; --time-unit says another unit")
    if "p" not in columns:
        notes.append("no column of polarities: all events are ON")
    if size is not None:
        notes.append(f"the first line gives the sensor: {size[0]} rows and {size[1]} columns")
    polarity = _polarity(path, columns.get("p"), len(time))
    return ForeignEvents(time, chosen, _addresses(path, columns), polarity, size, tuple(notes))


def _text_columns(path: Path) -> tuple[dict[str, Any], tuple[int, int] | None]:
    """Return the columns of a text by name, or by number without a header, and rows and columns of the sensor.

    A first line of two numbers is the width and the height of the sensor, as ESIM writes it.
    """
    data = content_of(path, "the table")
    text, _ = decoded(path, data)
    lines = [line for line in text.splitlines() if line.strip() and not COMMENT.match(line)]
    if not lines:
        raise InputError(f"{path} is empty; give a table with a line for each event")
    mark = delimiter_of(lines)
    first, last = (split(line, mark if mark and mark in line else None) for line in (lines[0], lines[-1]))
    size = None
    if len(first) == 2 and all(cell.isdigit() for cell in first) and len(last) > 2:
        size, lines = (int(first[1]), int(first[0])), lines[1:]
    try:
        frame = read_text(path, "\n".join(lines).encode(), Layout(remedy=REMEDY, comma_remedy=COMMA_REMEDY))
    except InputError as error:
        raise InputError(str(error).replace("samples", "events").replace("sample", "event")) from None
    if len(set(frame.names)) < len(frame.names):
        raise InputError(f"{path} has two columns of the same name: {', '.join(frame.names)}; rename one")
    names = frame.names if frame.named else tuple(str(n) for n in range(len(frame.names)))
    return {name: _parsed(path, name, frame.cells[n]) for n, name in enumerate(names)}, size


def _parsed(path: Path, name: str, cells: Any) -> NDArray[Any]:
    """Return a column as integers or floats; an unknown column may stay text."""
    import pandas

    if cells.dtype.kind == "b":
        return np.asarray(cells.to_numpy(np.int64))
    if cells.dtype.kind in "iuf":
        return np.asarray(cells.to_numpy())
    words = cells.astype(str).str.strip().str.lower().replace({"true": "1", "false": "0", "on": "1", "off": "0"})
    numbers = pandas.to_numeric(words, errors="coerce")
    wrong = np.flatnonzero(numbers.isna().to_numpy())
    if not len(wrong):
        if numbers.dtype == object or words.str.fullmatch(r"[-+]?\d{19,}").any():
            raise InputError(f"{path}: column {name} has numbers beyond 63 bits")
        return np.asarray(numbers.to_numpy())
    if any(name.lower() in names for names in NAMES.values()):
        at = int(wrong[0])
        raise InputError(f"{path}: event {at} has {name} {str(cells.iloc[at])!r}, which is not a number")
    return np.asarray(cells.astype(str).to_numpy())


def _array_columns(path: Path) -> dict[str, NDArray[Any]]:
    columns = arrays_in(path, content_of(path, "the table"), "an array file; write it again with numpy.save")
    if isinstance(columns, np.ndarray):
        if columns.dtype.names and columns.ndim == 1:
            for name in columns.dtype.names:
                if columns[name].ndim > 1:
                    raise InputError(f"{path}: an event has {name} of shape {columns[name].shape[1:]}, not one number")
            return {name: columns[name] for name in columns.dtype.names}
        if columns.ndim == 2 and columns.dtype.kind in "iuf":
            return {str(n): columns[:, n] for n in range(columns.shape[1])}
        raise InputError(f"{path} has shape {columns.shape} of {columns.dtype}; events are rows of t, x, y, p")
    lengths = {array.shape for array in columns.values()}
    if len(lengths) != 1 or len(next(iter(lengths))) != 1:
        raise InputError(
            f"{path} holds arrays of shapes {sorted(lengths)}; events need one array for each column, all of one length"
        )
    return columns


def _named(
    path: Path, columns: Mapping[str, NDArray[Any]], fields: Sequence[str]
) -> tuple[dict[str, NDArray[Any]], str | None]:
    """Return the columns by the names t, x, y, p, address, and the unit in the name of the time column."""
    if fields:
        if unknown := [field for field in fields if field not in (*NAMES, "-")]:
            raise InputError(f"--fields names {unknown[0]!r}; columns are {', '.join(NAMES)}, or - for others")
        if len(fields) != len(columns):
            raise InputError(f"--fields names {len(fields)} columns, but {path} has {len(columns)}")
        named = [(field, array) for field, array in zip(fields, columns.values(), strict=True) if field != "-"]
        if len(dict(named)) < len(named):
            raise InputError(f"--fields {','.join(fields)} names a column twice; name every column once")
        return dict(named), None
    found: dict[str, NDArray[Any]] = {}
    unit = None
    for name, array in columns.items():
        plain = name.strip().lower()
        match = _UNIT.match(plain)
        base = match[1].strip() if match else plain
        for ours, known in NAMES.items():
            if base in known and (match is None or ours == "t"):
                if ours in found:
                    raise InputError(
                        f"{path} has two columns for {ours}: {', '.join(columns)}; choose one with --fields"
                    )
                found[ours] = array
                unit = match[2].replace("µ", "u") if match else unit
    if not found:
        raise InputError(
            f"{path} does not name its {len(columns)} columns; name them with --fields, such as --fields x,y,t,p"
        )
    return found, unit


def _addresses(path: Path, columns: Mapping[str, NDArray[Any]]) -> NDArray[np.int64]:
    pair = [name for name in ("x", "y") if name in columns]
    if "address" in columns and pair:
        raise InputError(
            f"{path} has both an address and {pair[0]}; choose the columns with --fields, with - for a column to skip"
        )
    if "address" not in columns and len(pair) < 2:
        raise InputError(f"{path} has no columns x and y, and no address; name the columns with --fields")
    names = pair or ["address"]
    for name in names:
        if columns[name].dtype.kind not in "iuf":
            raise InputError(f"{path}: column {name} must hold whole numbers, not {columns[name].dtype}")
        whole = columns[name] == np.rint(columns[name])
        if not whole.all():
            at = int(np.argmin(whole))
            raise InputError(f"{path}: event {at} has {name} {columns[name][at]}, which is not a whole number")
    if not pair:
        return columns["address"].astype(np.int64)
    return np.stack([columns[name].astype(np.int64) for name in names], axis=1)


def _polarity(path: Path, column: NDArray[Any] | None, events: int) -> NDArray[np.bool_]:
    if column is None:
        return np.ones(events, bool)
    values = set(np.unique(column).tolist())
    if not (values <= {0, 1} or values <= {-1, 1}):
        raise InputError(f"{path}: polarities are 0 and 1, or -1 and 1; this column has {sorted(values)[:4]}")
    return np.asarray(column > 0)


def write_events_table(path: Path, recording: Recording, unit: str) -> str:
    """Write events as .csv or structured .npy; return a warning about lost time resolution, or an empty text.

    ``unit``: "us" or "clocks". Unit of t since the end of reset; microseconds are rounded half to even.
    """
    events = in_unit(recording, unit)
    with atomic_write(path) as file:
        if path.suffix == ".npy":
            np.save(file, events)
        else:
            file.write(f"t_{unit},x,y,p\n".encode())
            np.savetxt(file, np.stack([events[n].astype(np.int64) for n in "txyp"], axis=1), "%d", ",")
    return lost_clocks(recording.events["t"], events["t"])
