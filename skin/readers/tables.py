"""Read tables of other programs: .parquet, .feather, .xlsx and .json."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np

from eskin.base.errors import InputError
from eskin.skin.readers.arrays import needed, of_arrays
from eskin.skin.readers.frame import Frame, numbered
from eskin.skin.readers.text import Layout, read_text


def read_arrow(path: Path, data: bytes) -> Frame:
    """Return the columns of a .parquet or .feather file."""
    needed("pyarrow", path)
    import pandas

    read = pandas.read_parquet if path.suffix.lower() == ".parquet" else pandas.read_feather
    try:
        cells: Any = read(io.BytesIO(data))
    except Exception:  # pyarrow raises many types, depending on what is damaged
        raise InputError(f"{path} is damaged or not a {path.suffix.lower()} file; write it again") from None
    if not isinstance(cells.index, pandas.RangeIndex):
        cells = cells.reset_index()
    return _named(path, cells)


def read_excel(path: Path, data: bytes, field: str) -> Frame:
    """Return the columns of a sheet of an .xlsx workbook, the first one or the one named ``field``."""
    needed("openpyxl", path)
    import pandas

    try:
        book = pandas.ExcelFile(io.BytesIO(data), engine="openpyxl")
    except Exception:  # as above
        raise InputError(f"{path} is damaged or not an .xlsx workbook; save it again") from None
    if field and field not in book.sheet_names:
        raise InputError(f"{path} has no sheet {field!r}; it has {', '.join(map(str, book.sheet_names))}")
    sheet = field or str(book.sheet_names[0])
    cells = book.parse(sheet, header=None, dtype=object)
    lines = ["\t".join("" if value is None or value != value else str(value) for value in row) for row in cells.values]
    frame = read_text(path, "\n".join(lines).encode(), Layout(delimiter="tab", decimal="point"))
    if len(book.sheet_names) == 1:
        return frame
    return frame.noting(f"the samples are sheet {sheet!r} of {len(book.sheet_names)}; --field chooses another")


def read_json_table(path: Path, data: bytes, field: str) -> Frame:
    """Return the columns of a .json file: records, lists by name, or an array of arrays; also a record a line."""
    import pandas

    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        try:
            content = [json.loads(line) for line in data.decode().splitlines() if line.strip()]
        except (ValueError, RecursionError):
            raise InputError(f"{path} is not JSON; write records, or a list for each column") from None
    if isinstance(content, dict) and field:
        if field not in content:
            raise InputError(f"{path} has no entry {field!r}; it has {', '.join(map(str, content))}")
        content = content[field]
    if isinstance(content, list) and content and all(isinstance(row, dict) for row in content):
        flat = [_flat(row) for row in content]
        return _named(path, pandas.DataFrame(flat))
    try:
        if isinstance(content, dict):
            arrays = {
                name: np.asarray(value) for name, value in content.items() if isinstance(value, (list, int, float))
            }
            return of_arrays(path, arrays, "")
        return of_arrays(path, {"samples": np.asarray(content)}, "")
    except ValueError:
        raise InputError(f"{path} has lists of different lengths; give each sample the same number of values") from None


def _flat(row: dict[str, Any]) -> dict[str, Any]:
    """Return a record whose lists have become numbered entries."""
    found: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, list):
            found |= {f"{name}{number}": one for number, one in enumerate(np.asarray(value).ravel().tolist())}
        elif isinstance(value, dict):
            found |= {f"{name}.{inner}": one for inner, one in _flat(value).items()}
        else:
            found[name] = value
    return found


def _named(path: Path, cells: Any) -> Frame:
    if not len(cells) or not len(cells.columns):
        raise InputError(f"{path} holds no samples; give at least one row")
    names = tuple(map(str, cells.columns))
    plain = cells.set_axis(range(len(names)), axis=1).reset_index(drop=True)
    named = names != numbered(len(names)) and names != tuple(map(str, range(len(names))))
    return Frame(plain, names if named else numbered(len(names)), named)
