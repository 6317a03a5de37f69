"""Check the fields of configurations, from files and ``--set NAME=VALUE``."""

import math
from collections.abc import Collection
from typing import Any, get_args, get_type_hints

from eskin.base.errors import InputError

LARGEST = (2 - 2**-23) * 2.0**127
"""Largest finite float32, in which networks compute."""

NOUNS = {bool: "true or false", int: "a whole number", float: "a number", str: "a word"}


def check_types(config: Any) -> None:
    """Check the types of all fields of a dataclass.

    A whole number is taken for a float, and so is the text of a float that JSON has not, as "-inf".

    Raise InputError if a field is of the wrong type.
    """
    for name, hint in get_type_hints(type(config)).items():
        value = getattr(config, name)
        if hint is float and (type(value) is int or value in ("inf", "-inf", "nan")):
            try:
                value = float(value)
            except OverflowError:
                raise InputError(f"{name} must be a number, not a number of {len(str(value))} digits") from None
            object.__setattr__(config, name, value)
        wanted = str if get_args(hint) else hint
        if type(value) is not wanted:
            raise InputError(f"{name} must be {NOUNS[wanted]}, not {value!r}")
        if isinstance(value, float) and LARGEST < abs(value) < math.inf:
            raise InputError(f"{name} must be a number of at most {LARGEST:.3g}, which float32 holds, not {value!r}")


def refuse_unknown(fields: Any, known: Collection[str], what: str) -> None:
    """Raise InputError if ``fields`` is no dictionary or contains unknown names."""
    if not isinstance(fields, dict):
        raise InputError(f"the fields of {what} must be a JSON object, not {type(fields).__name__}")
    if unknown := sorted(set(map(str, fields)) - set(known)):
        raise InputError(f"unknown {what} field {unknown[0]!r}; known fields are {', '.join(sorted(known))}")
