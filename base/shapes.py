"""Check the structure of the project's JSON files."""

import math
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import read_json

Shape = Any
"""A type, a tuple of types, ``[shape]`` for a list of any length, ``{name: shape}`` for an object with these fields."""


def misfit(value: Any, shape: Shape, place: str = "it") -> str:
    """Return a description of the first error in JSON content, or an empty string.

    A float may be any finite number, an int only a whole number from 0 on; ``object`` is anything.

    Examples
    --------
    >>> misfit({"runs": [1, None]}, {"runs": [int]})
    'runs[1] is null'
    >>> misfit({"runs": [1]}, {"runs": [int], "name": str})
    'name is missing'
    """
    if isinstance(shape, dict):
        if not isinstance(value, dict):
            return f"{place} is no object"
        for name, inner in shape.items():
            at = name if place == "it" else f"{place}.{name}"
            if wrong := f"{at} is missing" if name not in value else misfit(value[name], inner, at):
                return wrong
        return ""
    if isinstance(shape, list):
        if not isinstance(value, list):
            return f"{place} is no list"
        return next((w for number, one in enumerate(value) if (w := misfit(one, shape[0], f"{place}[{number}]"))), "")
    return "" if _fits(value, shape) else f"{place} is {'null' if value is None else repr(value)[:40]}"


def _fits(value: Any, kind: Any) -> bool:
    if isinstance(kind, tuple):
        return any(_fits(value, one) for one in kind)
    if kind is None:
        return value is None
    if kind is float:
        return type(value) in (int, float) and math.isfinite(value)
    if kind is int:
        return type(value) is int and value >= 0
    return isinstance(value, kind)


def read_shaped(path: Path, what: str, shape: Shape, remedy: str = "remove it") -> Any:
    """Return the content of a JSON file after checking its structure; raise InputError for another shape."""
    content = read_json(path, what)
    if wrong := misfit(content, shape):
        raise InputError(f"{what} {path} is damaged: {wrong}; {remedy}")
    return content
