"""Read a table in text: find its delimiter, its header and its frames, and let pandas read the cells."""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from eskin.base.errors import InputError
from eskin.skin.readers.frame import Frame, check_size, numbered

COMMENT = re.compile(r"\s*(#|%|//)")
MISSING = ("", "nan", "na", "n/a", "null", "none", "-", "--")
"""Words for a cell without a number, in lower case."""

NEWEST = 50
"""Lines at the end of a file, at most half of all, that show what a line of samples looks like."""

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|[-+]?(inf|infinity)", re.IGNORECASE)
_UNIT = re.compile(
    r"[\[(<{].*[\])>}]|[munkµ]?(s|sec|secs|v|a|n|pa|g|m|f|hz|ohm|bar|t|c)|°?c|deg\w*|%|a\.?u\.?|counts?|adc|raw|lsb|-|bits?"
    r"|seconds|volts?|newtons?|mm|cm|psi|mbar|int\d*|float\d*",
    re.IGNORECASE,
)
_COMMA, _THOUSANDS = re.compile(r"[-+]?\d+,\d+"), re.compile(r"[-+]?[1-9]\d{0,2},\d{3}")


@dataclass(frozen=True)
class Layout:
    """How the lines of a text are to be read."""

    delimiter: str = ""  # a character, tab or space; found if empty
    decimal: str = "auto"  # point, comma or auto
    skip_lines: int = 0  # lines before the table
    frame_lines: int = 0  # lines of a sample; found if 0
    remedy: str = "set --delimiter and --decimal"  # what the user can do if the cells are not found
    comma_remedy: str = "add --decimal comma, or remove the separators of thousands"


@dataclass
class _Text:
    """A text while it is read."""

    path: Path
    lines: list[str]  # without blank lines and comments
    numbers: list[int]  # of these lines in the file, from 1
    mark: str | None  # delimiter; None for white space
    comma: bool  # decimal comma
    remedy: str
    notes: list[str] = field(default_factory=list)

    @property
    def newest(self) -> list[str]:
        """The last lines, which show what a line of samples looks like."""
        return self.lines[-min(NEWEST, (len(self.lines) + 1) // 2) :]

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line; a cell in double quotes may contain the delimiter."""
        return split(line, self.mark)

    def is_number(self, cell: str) -> bool:
        """Return True if a cell is a number."""
        return _NUMBER.fullmatch(cell.replace(",", ".") if self.comma else cell) is not None


def split(line: str, mark: str | None) -> list[str]:
    """Return the cells of a line, without spaces and quotes around them."""
    if '"' not in line:
        return [cell.strip() for cell in line.split(mark)]
    import csv

    if mark is None:
        return [cell.strip('"') for cell in line.split()]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=mark, skipinitialspace=True), [])]
    except csv.Error:
        return [cell.strip().strip('"') for cell in line.split(mark)]


def read_text(path: Path, data: bytes, layout: Layout) -> Frame:
    """Return the columns of a table in text.

    Lines of other width and texts above the samples are a header: names, units, a size such as ``8,8``, remarks.

    Raise InputError if the file is no text, holds no line of numbers, or its lines do not fit together.
    """
    text, notes = decoded(path, data)
    raw = text.splitlines()
    used = [(n, line) for n, line in enumerate(raw, 1) if n > layout.skip_lines and not COMMENT.match(line)]
    lines, numbers = [line for _, line in used if line.strip()], [n for n, line in used if line.strip()]
    if not lines:
        raise InputError(f"{path} holds no samples; give at least one line of numbers")
    mark = {"tab": "\t", "space": None, "": delimiter_of(lines)}.get(layout.delimiter, layout.delimiter)
    found = _Text(path, lines, numbers, mark, False, layout.remedy, notes)
    found.comma = _has_decimal_comma(found, layout)
    height = layout.frame_lines or _lines_of_a_frame(found, [line for _, line in used])
    if height > 1:
        return _read_frames(found, height, detected=not layout.frame_lines)
    return _read_table(found)


def decoded(path: Path, data: bytes) -> tuple[str, list[str]]:
    """Return the text in the content of a file, and notes; raise InputError if it is no text."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        try:
            return data.decode("utf-16"), ["the text is UTF-16"]
        except UnicodeDecodeError:
            raise InputError(f"{path} is damaged UTF-16; save it as text in UTF-8") from None
    if b"\0" in data:
        raise InputError(f"{path} is not text; save it as comma-separated values in UTF-8")
    try:
        return data.decode("utf-8-sig"), []
    except UnicodeDecodeError:
        if any(byte < 9 for byte in data[:4096]):
            raise InputError(f"{path} is not text; save it as comma-separated values in UTF-8") from None
        return data.decode("latin-1"), ["the text is not UTF-8 and was read as Latin-1"]


def delimiter_of(lines: Sequence[str]) -> str | None:
    """Return the delimiter of cells: tab, semicolon or comma, or None for white space."""
    return next((mark for mark in ("\t", ";", ",") if all(mark in line for line in lines[-2:])), None)


def _has_decimal_comma(found: _Text, layout: Layout) -> bool:
    if layout.decimal != "auto":
        if layout.decimal == "comma" and found.mark == "," and not any('"' in line for line in found.lines[-2:]):
            raise InputError("a decimal comma needs another delimiter; add --delimiter, such as ';'")
        return layout.decimal == "comma"
    cells = [cell for line in found.newest for cell in found.cells(line)]
    commas = [cell for cell in cells if _COMMA.fullmatch(cell)]
    if found.mark == "," and commas and all(_THOUSANDS.fullmatch(cell) for cell in commas):
        raise InputError(
            f"{found.path}: the comma in {commas[0]!r} may be a decimal comma or separate thousands; "
            f"{layout.comma_remedy}"
        )
    return bool(commas)


# -- a line for each sample --------------------------------------------------------------------------


def _read_table(found: _Text) -> Frame:
    import pandas

    widths = [len(found.cells(line)) for line in found.newest]
    width = Counter(widths).most_common(1)[0][0]
    first = _first_sample(found, width)
    names, shape = _header(found, first, width)
    check_size(found.path, (len(found.lines) - first) * width)
    body, dropped = _samples(found, first, width)
    kwargs: dict[str, Any] = {"sep": found.mark} if found.mark else {"sep": r"\s+"}
    try:
        cells = pandas.read_csv(
            io.StringIO("\n".join(body)),
            header=None,
            names=range(width),
            index_col=False,
            skipinitialspace=True,
            keep_default_na=False,
            na_values=[form for word in MISSING for form in {word, word.upper(), word.title(), "NaN", "N/A"}],
            decimal="," if found.comma else ".",
            low_memory=False,
            skip_blank_lines=False,
            **kwargs,
        )
    except (ValueError, pandas.errors.ParserError) as error:
        reason = " ".join(str(error).split()).removeprefix("Error tokenizing data. C error: ")
        raise InputError(f"{found.path} is not a table: {reason}; {found.remedy}") from None
    if dropped:
        found.notes.append(dropped)
    named = names is not None
    names = list(names or numbered(width))
    if not cells[width - 1].notna().any() and (not named or not names[width - 1]) and width > 1:
        cells, names = cells.iloc[:, :-1], names[:-1]  # a delimiter at the end of each line
    return Frame(cells, tuple(names), named, tuple(found.notes), None, shape)


def _first_sample(found: _Text, width: int) -> int:
    """Return the index of the first line with the width of a sample, and numbers where most samples have them."""
    ends = [cells for line in found.newest if len(cells := found.cells(line)) == width]
    share = [sum(found.is_number(cells[k]) for cells in ends) / len(ends) for k in range(width)]
    numeric = [k for k in range(width) if share[k] > 0.5]
    if not numeric:
        if len(found.lines) == 1:
            raise InputError(f"{found.path} holds no samples below its header; give at least one line of numbers")
        cells = found.cells(found.lines[-1])
        raise InputError(
            f"{found.path} is not a table of numbers: line {found.numbers[-1]} has {cells[0]!r}; {found.remedy}"
        )
    for index, line in enumerate(found.lines):
        cells = found.cells(line)
        if len(cells) != width:
            continue
        usual = [found.is_number(cells[k]) or cells[k].lower() in MISSING for k in numeric]
        if any(found.is_number(cells[k]) for k in numeric) and sum(usual) > 0.5 * len(usual):
            return index
    raise InputError(f"{found.path} holds no samples below its header; give at least one line of numbers")


def _header(found: _Text, first: int, width: int) -> tuple[list[str] | None, tuple[int, int] | None]:
    """Return the names in the lines above the samples, and the size of the array if a line has it."""
    shape, titles, others = None, list[tuple[int, list[str]]](), []
    for number, line in zip(found.numbers, found.lines[:first], strict=False):
        cells = found.cells(line)
        full = [cell for cell in cells if cell]
        sides = [int(cell) for cell in full if cell.isdigit()]
        if len(full) == len(sides) == 2 and sides[0] * sides[1] in (width, width - 1):
            shape = sides[0], sides[1]
            found.notes.append(f"line {number} gives the array: {shape[0]} x {shape[1]} taxels")
        elif len(cells) >= width - 1 and sum(map(found.is_number, full)) <= 0.5 * len(full):
            titles.append((number, cells))
        else:
            others.append(number)
    plain = [(number, cells) for number, cells in titles if not _are_units(cells)]
    if not plain and titles and len(set(titles[-1][1])) == len(titles[-1][1]) and "[" not in titles[-1][1][0]:
        plain = titles[-1:]  # columns named t, a, v
    units = [number for number, cells in titles if (number, cells) not in plain and _are_units(cells)]
    found.notes.extend(f"line {number} holds units" for number in units)
    names = plain[-1][1] if plain else None
    others = sorted([*others, *(number for number, _ in plain[:-1])])
    if others:
        lines = f"lines {others[0]} to {others[-1]}" if len(others) > 1 else f"line {others[0]}"
        found.notes.append(f"{lines} above the samples left out; --skip-lines chooses where the table begins")
    if names is None:
        return None, shape
    if len(names) > width and not any(names[width:]):
        names = names[:width]
    if len(names) == width - 1:
        last = [cells[-1] for line in found.lines[first : first + NEWEST] if len(cells := found.cells(line)) == width]
        names = [*names, ""] if not any(last) else ["", *names]  # a delimiter at the end, or numbers of the rows
    if len(names) != width:
        raise InputError(f"{found.path} names {len(names)} columns, but has {width}; repair its header")
    return names, shape


def _are_units(cells: Sequence[str]) -> bool:
    """Return True if all cells of a line are units."""
    full = [cell for cell in cells if cell]
    return len(full) > 1 and all(_UNIT.fullmatch(cell) for cell in full)


def _samples(found: _Text, first: int, width: int) -> tuple[list[str], str]:
    """Return the lines of samples, and a note if the last line is cut off."""
    body, note = found.lines[first:], ""
    if found.mark is None:
        short = [k for k, line in enumerate(body) if len(line.split()) != width and '"' not in line]
    else:
        marks = width - 1
        short = [
            k for k, line in enumerate(body) if line.count(found.mark) != marks and len(found.cells(line)) != width
        ]
    if short and short[0] == len(body) - 1 and len(body) > 1 and len(found.cells(body[-1])) < width:
        note = f"line {found.numbers[first + short[0]]} is cut off and left out"
        return body[:-1], note
    if short:
        at = short[0]
        count = len(found.cells(body[at]))
        raise InputError(
            f"{found.path}: line {found.numbers[first + at]} has {count} cells, but a sample has {width}; repair this "
            f"line, or {found.remedy}"
        )
    return body, note


# -- several lines for each sample -------------------------------------------------------------------


def _lines_of_a_frame(found: _Text, lines: Sequence[str]) -> int:
    """Return the number of lines of a sample: blank lines stand between blocks of equal size; 1 for a table."""
    blocks, count = [], 0
    for line in [*lines, ""]:
        if line.strip():
            count += 1
        elif count:
            blocks.append(count)
            count = 0
    heights = set(blocks[1:]) if len(blocks) > 2 else set()
    if len(heights) != 1 or (height := heights.pop()) < 2:
        return 1
    tail = [found.cells(line) for line in found.lines[-height * min(len(blocks) - 1, 10) :]]
    even = len({len(cells) for cells in tail}) == 1 and all(found.is_number(cell) for cells in tail for cell in cells)
    return height if even else 1


def _read_frames(found: _Text, height: int, detected: bool) -> Frame:
    """Return a table whose samples are matrices of several lines."""
    import pandas

    rows = [[cell for cell in found.cells(line) if cell] for line in found.lines]
    width = len(rows[-1])
    start = next(k for k, cells in enumerate(rows) if len(cells) == width and all(map(found.is_number, cells)))
    rows = rows[start:]
    wrong = next((k for k, cells in enumerate(rows) if len(cells) != width), None)
    if wrong is not None or len(rows) % height:
        at = found.numbers[start + (len(rows) - 1 if wrong is None else wrong)]
        raise InputError(
            f"{found.path}: line {at} does not fit samples of {height} lines of {width} numbers; set --frame-lines"
        )
    try:
        plain = [[cell.replace(",", ".") if found.comma else cell for cell in cells] for cells in rows]
        values = np.array(plain, np.float64).reshape(-1, height * width)
    except ValueError as error:
        raise InputError(f"{found.path} is not a table of numbers: {error}; set --frame-lines 1") from None
    whole = all(re.fullmatch(r"[-+]?\d+", cell) for cells in rows[: 4 * height] for cell in cells)
    if whole and (values == np.rint(values)).all():
        values = values.astype(np.int64)
    if detected:
        found.notes.append(
            f"a sample is {height} lines of {width} numbers: {height} x {width} taxels; --frame-lines 1 reads each "
            f"line as a sample"
        )
    cells = pandas.DataFrame(values)
    return Frame(cells, numbered(height * width), False, tuple(found.notes), None, (height, width))
