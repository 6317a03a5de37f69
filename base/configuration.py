"""Base of all configurations: checks of types and ranges, copies, and dictionaries."""

import dataclasses
import json
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Self, get_args, get_type_hints

from eskin.base.errors import InputError


def parameter(default: Any, unit: str, source: str, meaning: str, option: str = "", values: str = "") -> Any:
    """Return a dataclass field with its unit, source, help text and command-line option.

    ``unit`` is empty for a pure number and a choice. ``option`` is by default the field's name without its unit.
    ``values`` stand in the help of the option if the type of the field does not list them.
    """
    metadata = {"unit": unit, "source": source, "meaning": meaning, "option": option, "values": values}
    return field(default=default, metadata=metadata)


def option_of(field: dataclasses.Field[Any]) -> str:
    """Return the command-line option of a field made by ``parameter``."""
    name = field.metadata["option"] or field.name.removesuffix(f"_{field.metadata['unit'].lower()}")
    return "--" + name.replace("_", "-")


def refuse_unknown(names: Collection[str], known: Collection[str], noun: str) -> None:
    """Raise InputError for a name that is no field; ``noun`` is the kind of configuration."""
    if unknown := sorted(set(names) - set(known)):
        raise InputError(f"unknown {noun} field {unknown[0]!r}; known fields are {', '.join(sorted(known))}")


def hints_of(cls: type) -> dict[str, Any]:
    """Return the types of the fields of a configuration class."""
    return {name: hint for name, hint, _ in _types(cls)}


def _read_types(cls: Any) -> list[tuple[str, Any, tuple[Any, ...]]]:
    hints = get_type_hints(cls)
    return [(one.name, hints[one.name], get_args(hints[one.name])) for one in dataclasses.fields(cls)]


_types: Callable[[Any], list[tuple[str, Any, tuple[Any, ...]]]] = cache(_read_types)
"""Return name, type and choices of the fields of a class; get_type_hints takes a millisecond."""


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """Base of configuration classes: checks of the fields, copies, and dictionaries."""

    noun = ("a configuration", "configuration")
    """Names of the configuration and of one of its fields in messages."""

    def _label(self, name: str) -> str:
        """Return the name of a field in messages."""
        return name

    def _check_types(self, but: Collection[str] = ()) -> None:
        """Check the types of all fields; convert an int to float if the field may be a float."""
        for name, hint, choices in _types(type(self)):
            value = getattr(self, name)
            if name in but:
                continue
            if choices and isinstance(choices[0], str):
                if value not in choices:
                    raise InputError(f"{self._label(name)} must be one of {', '.join(choices)}, not {value!r}")
            elif type(value) is int and float in (hint, *choices) and abs(value) < 2**53:
                object.__setattr__(self, name, float(value))
            elif type(value) not in (choices or (hint,)):
                wanted = " or ".join("None" if one is type(None) else one.__name__ for one in choices or (hint,))
                raise InputError(f"{self._label(name)} must be of type {wanted}, not {value!r}")

    def _check_range(self, name: str, low: float, high: float, high_name: str = "", low_name: str = "") -> None:
        value = getattr(self, name)
        if not low <= value <= high:
            ends = [f"{end:g}" if isinstance(end, float) else f"{end}" for end in (low, high)]
            least, most = (f"{n} = {end}" if n else end for n, end in zip((low_name, high_name), ends, strict=True))
            raise InputError(f"{self._label(name)} must be in {least}..{most}, not {value}")

    def _check_least(self, name: str, least: int) -> None:
        if (value := getattr(self, name)) < least:
            raise InputError(f"{self._label(name)} must be at least {least}, not {value}")

    def replace(self, **changes: Any) -> Self:
        """Return a validated copy with changed fields."""
        self._check_names(changes)
        return dataclasses.replace(self, **changes)

    def to_dict(self) -> dict[str, Any]:
        """Return all fields as a dictionary."""
        return dataclasses.asdict(self)

    def to_json(self) -> str:
        """Return the configuration as JSON text."""
        return json.dumps(self.to_dict(), indent=2)

    @classmethod
    def from_dict(cls, fields: Any) -> Self:
        """Return the configuration for a dictionary; raise an error for unknown fields."""
        cls._check_dict(fields)
        return cls(**fields)

    @classmethod
    def _check_dict(cls, fields: Any) -> None:
        """Raise InputError if ``fields`` is no dictionary or contains unknown names."""
        if not isinstance(fields, dict):
            raise InputError(f"{cls.noun[0]} must be a JSON object, not {type(fields).__name__}")
        cls._check_names(fields)

    @classmethod
    def _check_names(cls, names: Collection[str]) -> None:
        refuse_unknown(names, {name for name, _, _ in _types(cls)}, cls.noun[1])
