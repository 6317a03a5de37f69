"""Format rows of data as text with templates, in which `` | `` separates the columns."""

import string
from collections.abc import Mapping, Sequence
from typing import Any

from eskin.base.units import plain, with_unit


def digits(value: float, count: int) -> str:
    """Return a number as text with significant digits, never with a power of ten."""
    text = f"{value:#.{count}g}"
    return (f"{value:.0f}" if "e" in text else text).removesuffix(".")


class Template(string.Formatter):
    """Formatter with additional kinds of values.

    ``{a[b]:1e9*.1f}`` multiplies first; ``#3`` gives three significant digits; ``~`` three digits or a whole number;
    ``@W`` a prefix and the unit W. A value that the data may lack is written ``{?name}``. A value that is missing or
    null becomes ``absent``.
    """

    def __init__(self, absent: str = "-") -> None:
        self.absent = absent

    def get_field(self, field_name: str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
        """Return the value of a field, or None for a missing optional field."""
        try:
            return super().get_field(field_name.removeprefix("?"), args, kwargs)
        except (KeyError, TypeError):
            if not field_name.startswith("?"):
                raise
            return None, ""

    def format_field(self, value: Any, format_spec: str) -> str:
        """Return a scaled value as text."""
        scale, _, spec = format_spec.rpartition("*")
        if value is None:
            return self.absent
        return self.format_value(value * float(scale) if scale else value, spec)

    def format_value(self, value: Any, spec: str) -> str:
        """Return a value as text."""
        if spec == "~":
            return plain(value)
        if spec.startswith("@"):
            return with_unit(value, spec[1:])
        return digits(value, int(spec[1:])) if spec.startswith("#") else format(value, spec)

    def filled(self, template: str, row: Mapping[str, Any]) -> str:
        """Return a template with ``{name:format}`` replaced by the values of a row."""
        return self.vformat(template, (), row)

    def cells(self, template: str, row: Mapping[str, Any]) -> list[str]:
        """Return the cells of a row; `` | `` separates the columns of the template."""
        return [self.filled(cell, row) for cell in template.split(" | ")]
