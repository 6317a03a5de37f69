"""Convert nested configurations to one flat dictionary and back, for files and ``--set NAME=VALUE``."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import Any, TypeVar, get_args, get_type_hints

from eskin.base.errors import InputError

Config = TypeVar("Config")

LARGEST = (2 - 2**-23) * 2.0**127
"""Largest finite float32, in which networks compute."""

_NOUNS = {bool: "true or false", int: "a whole number", float: "a number", str: "a word"}


def flatten(config: Any) -> dict[str, Any]:
    """Return the fields of a dataclass and its nested dataclasses by name."""
    found: dict[str, Any] = {}
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        found |= flatten(value) if dataclasses.is_dataclass(value) else {field.name: value}
    return found


def hints_of(kind: type) -> dict[str, Any]:
    """Return the type of every flat field of a dataclass by name."""
    found: dict[str, Any] = {}
    for name, hint in get_type_hints(kind).items():
        found |= hints_of(hint) if dataclasses.is_dataclass(hint) else {name: hint}  # type: ignore[arg-type]
    return found


def unflatten(kind: type[Config], fields: dict[str, Any]) -> Config:
    """Return a dataclass for flat fields; missing fields take their defaults.

    A whole number is taken for a float, and so is the text of a float that JSON has not, as "-inf".

    Raise InputError if a field is of the wrong type.
    """
    made: dict[str, Any] = {}
    for name, hint in get_type_hints(kind).items():
        if dataclasses.is_dataclass(hint):
            made[name] = unflatten(hint, fields)  # type: ignore[arg-type]
        elif name in fields:
            value = fields[name]
            made[name] = value if dataclasses.is_dataclass(value) else _checked(name, value, hint)
    return kind(**made)


def takes_flat_fields(cls: type[Config]) -> type[Config]:
    """Class decorator: let the constructor of a dataclass accept the fields of its nested dataclasses."""
    made: Any = cls
    own, initialise = {field.name for field in dataclasses.fields(made)}, made.__init__

    @functools.wraps(initialise)
    def __init__(self: Any, **fields: Any) -> None:
        initialise(self, **(fields if own >= set(fields) else vars(made.from_dict(fields))))

    made.__init__ = __init__
    return cls


def refuse_unknown(fields: Any, known: Any, what: str) -> None:
    """Raise InputError if ``fields`` is no dictionary or contains unknown names."""
    if not isinstance(fields, dict):
        raise InputError(f"the fields of {what} must be a JSON object, not {type(fields).__name__}")
    if unknown := sorted(set(map(str, fields)) - set(known)):
        raise InputError(f"unknown {what} field {unknown[0]!r}; known fields are {', '.join(sorted(known))}")


def _checked(name: str, value: Any, hint: Any) -> Any:
    if hint is float and (type(value) is int or value in ("inf", "-inf", "nan")):
        try:
            value = float(value)
        except OverflowError:
            raise InputError(f"{name} must be a number, not a number of {len(str(value))} digits") from None
    wanted = str if get_args(hint) else hint
    if type(value) is not wanted:
        raise InputError(f"{name} must be {_NOUNS.get(wanted, wanted.__name__)}, not {value!r}")
    if isinstance(value, float) and LARGEST < abs(value) < math.inf:
        raise InputError(f"{name} must be a number of at most {LARGEST:.3g}, which float32 holds, not {value!r}")
    return value
