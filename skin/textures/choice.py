"""Select taxels of an array: lines, corners, checkerboard, random taxels, or a list (docs/guide/classifier.md)."""

import re

import numpy as np

from eskin.base.errors import InputError

CHOICES = "across:K|along:K|corners|checkerboard|random:K:SEED|NUMBER+NUMBER..."
"""Forms in which the command line selects taxels."""


def choose(text: str, rows: int, columns: int) -> tuple[int, ...]:
    """Return the indices of the selected taxels of an array, in rising order.

    ``across:K`` are K taxels of the first column, evenly spread over the rows; the skin slides along its rows, so they
    read K lines of the surface. ``along:K`` are K taxels of the middle row, which read one line after each other.
    ``checkerboard`` is every second taxel.

    Raise InputError if the text is no choice, or the array has too few taxels for it.
    """
    kind, *numbers = text.split(":")
    places = np.arange(rows * columns).reshape(rows, columns)
    try:
        counts = [int(number) for number in numbers]
        if kind in ("across", "along") and len(counts) == 1:
            line = places[:, 0] if kind == "across" else places[rows // 2]
            return _of(line[_spread(len(line), counts[0])])
        if kind == "corners" and not counts:
            return _of(places[[0, 0, -1, -1], [0, -1, 0, -1]])
        if kind == "checkerboard" and not counts:
            return _of(places[np.add.outer(np.arange(rows), np.arange(columns)) % 2 == 0])
        if kind == "random" and len(counts) == 2:
            return _of(np.random.default_rng(counts[1]).choice(places.size, counts[0], replace=False))
        if re.fullmatch(r"\d+(\+\d+)*", text, re.ASCII):
            listed = [int(word) for word in text.split("+")]
            if again := [number for number in dict.fromkeys(listed) if listed.count(number) > 1]:
                raise InputError(f"--taxels {text} has taxel {again[0]} twice; name every taxel once")
            return _of(places.ravel()[listed])
        raise ValueError
    except InputError:
        raise
    except (ValueError, IndexError):
        raise InputError(
            f"choose taxels of {rows} x {columns} by {CHOICES}, with numbers in 0..{rows * columns - 1}, not {text!r}"
        ) from None


def _spread(length: int, count: int) -> list[int]:
    """Return evenly spread positions on a line, including both ends; a single position is the first."""
    if not 1 <= count <= length:
        raise ValueError
    return [round(place) for place in np.linspace(0, length - 1, count)]


def _of(taxels: np.typing.ArrayLike) -> tuple[int, ...]:
    return tuple(np.unique(taxels).tolist())
