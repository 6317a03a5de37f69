"""Base of the configurations of networks and trainings."""

import dataclasses
import math
from collections.abc import Collection

from eskin.base.configuration import Configuration, hints_of
from eskin.base.errors import InputError

LARGEST = (2 - 2**-23) * 2.0**127
"""Largest finite float32, in which networks compute."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class NetworkFields(Configuration):
    """Base of configurations whose floats are those of float32; files have the text of a float that JSON lacks."""

    def _check_types(self, but: Collection[str] = ()) -> None:
        hints = hints_of(type(self))
        floats = [field.name for field in dataclasses.fields(self) if hints[field.name] is float]
        for name in floats:
            if getattr(self, name) in ("inf", "-inf", "nan"):
                object.__setattr__(self, name, float(getattr(self, name)))
        super()._check_types(but)
        for name in floats:
            if LARGEST < abs(value := getattr(self, name)) < math.inf:
                most = f"{LARGEST:.3g}, which float32 holds"
                raise InputError(f"{name} must be a number of at most {most}, not {value!r}")
