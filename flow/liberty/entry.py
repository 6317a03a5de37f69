"""Groups of a Liberty file, with checks and error messages for every field."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.files import read_bytes
from eskin.base.packages import missing
from eskin.base.units import counted

MOST = 1e15
"""Largest number that an attribute may have, in the units of the file."""


@dataclass(frozen=True)
class Entry:
    """A group of a Liberty file."""

    group: Any
    path: Path
    place: str  # the group as a sentence names it: ``the library``, ``pin A of cell NAND``

    def wrong(self, part: str, what: str) -> InputError:
        """Return an exception about a part of this group."""
        return InputError(f"the cell library {self.path} is wrong: {part} of {self.place} {what}; give another .lib")

    def all(self, kind: str) -> list[Entry]:
        """Return the inner groups of a kind."""
        return [Entry(group, self.path, f"{kind} of {self.place}") for group in self.group.get_groups(kind)]

    def named(self, kind: str) -> dict[str, Entry]:
        """Return the inner groups of a kind, by name."""
        within = "" if self.place == "the library" else f" of {self.place}"
        found = {}
        for entry in self.all(kind):
            (name,) = entry.names(1)
            if name in found:
                raise self.wrong(f"{kind} ({name})", "stands twice")
            found[name] = Entry(entry.group, self.path, f"{kind} {name}{within}")
        return found

    def names(self, count: int) -> list[str]:
        """Return the names in the parentheses of the group."""
        found = [text for argument in self.group.args if (text := _text(argument))]
        if len(found) != count:
            raise self.wrong("the brackets", f"must hold {counted(count, 'name')}, not {len(found)}")
        return found

    def value(self, name: str) -> Any:
        """Return an attribute as the parser gives it; None if absent."""
        found = self.group.get_attributes(name)
        if len(found) > 1:
            raise self.wrong(name, "stands twice")
        return found[0] if found else None

    def text(self, name: str) -> str:
        """Return an attribute as text; empty if absent."""
        value = self.value(name)
        return _text(value[0] if value else None) if isinstance(value, list) else _text(value)

    def flag(self, name: str) -> bool:
        """Return True if an attribute is present and true."""
        return self.text(name) == "true"

    def number(self, name: str, default: float = 0.0, least: float = -math.inf) -> float:
        """Return an attribute as a finite number of at least ``least``."""
        value = self.value(name)
        text = f"({', '.join(map(_text, value))})" if isinstance(value, list) else _text(value)
        if not text:
            return default
        number = _number(text)
        if not (least <= number and abs(number) <= MOST):  # of no number neither holds
            raise self.wrong(name, f"must be a number{f' from {least:g} on' if least > -math.inf else ''}, not {text}")
        return number

    def numbers(self, name: str) -> NDArray[np.float64]:
        """Return the numbers of an attribute, shape (rows, columns)."""
        value = self.value(name)
        rows = [_text(row).replace(",", " ").split() for row in (value if isinstance(value, list) else [value])]
        found = [[_number(word) for word in row] for row in rows]
        if len({len(row) for row in found}) != 1 or not found[0] or not np.isfinite(found).all():
            raise self.wrong(name, "must be rows of finite numbers, equally many in each")
        return np.array(found)


def parse(path: Path) -> Entry:
    """Return the top group of a Liberty file."""
    try:
        from liberty.parser import parse_liberty
    except ModuleNotFoundError:
        raise InputError(missing("liberty")) from None
    try:
        text = read_bytes(path, "the cell library").decode(errors="replace")
    except OSError as error:
        raise InputError(f"cannot read the cell library {path}: {error.strerror}") from None
    try:
        group = parse_liberty(text)
    except Exception as error:  # a broken file makes the parser raise any of a dozen types
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0].rstrip(".,;:")
        raise InputError(f"{path} cannot be read as a Liberty file: {reason}; give a .lib") from None
    if group is None or group.group_name != "library":
        raise InputError(f"{path} is not a Liberty file: it has no library(...); give a .lib")
    return Entry(group, path, "the library")


def _text(value: Any) -> str:
    return "" if value is None else str(value).strip('"').strip()


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
