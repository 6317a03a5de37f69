"""Receptive fields: the encoder of a taxel compares a sum of samples (docs/reference/fields.md)."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError

if TYPE_CHECKING:  # a configuration checks its fields
    from eskin.model.config import ReadoutConfig

KINDS = ("own", "neighbours", "both")
"""Names of receptive fields that are equal for every taxel."""

SETTABLE = "settable"
"""Name for fields that a host chooses at run time; after reset the field of every taxel is its own sample."""

CHOICES = (*KINDS, "off")
"""Fields that a host can choose, by number."""

MAX_TAXELS = 256
"""Most taxels of a field."""

ANALOG_RANGE = 4
"""Largest magnitude of an analog signal, in full scales."""


class Field(NamedTuple):
    """A receptive field: the taxels whose samples are added, and the right shift of the sum.

    A taxel that is listed several times counts several times. A field without taxels is off.
    """

    taxels: tuple[int, ...]
    shift: int = 0

    def to_dict(self) -> dict[str, Any]:
        """Return the field as a dictionary for JSON."""
        return {"taxels": list(self.taxels), "shift": self.shift}


Fields = str | tuple[Field, ...]
"""A name of ``KINDS``, ``settable``, or a field for every taxel."""


def parse(given: Any, taxels: int) -> Fields:
    """Return the checked receptive fields of a configuration.

    ``given`` is a name; or for every taxel a Field, taxels and a shift, or a dictionary of both; or these as JSON text.
    """
    if isinstance(given, str) and given in (*KINDS, SETTABLE):
        return given
    if isinstance(given, str) and given.lstrip().startswith("["):
        try:
            given = json.loads(given)
        except (ValueError, RecursionError) as error:
            raise InputError(f"receptive_fields are not JSON: {error}") from None
    if isinstance(given, str) or not isinstance(given, Sequence):
        names = ", ".join((*KINDS, SETTABLE))
        raise InputError(
            f"receptive_fields must be {names}, or a list with taxels and shift of every taxel, not {given!r}"
        )
    if len(given) != taxels:
        raise InputError(f"receptive_fields must list a field for each of the {taxels} taxels, not {len(given)}")
    found = tuple(_parse_one(number, one, taxels) for number, one in enumerate(given))
    if not any(field.taxels for field in found):
        raise InputError("receptive_fields must leave a taxel on, but no field has a taxel")
    return "own" if found == tuple(kind("own", 1, taxels, taxel) for taxel in range(taxels)) else found


def _parse_one(number: int, given: Any, taxels: int) -> Field:
    if isinstance(given, Mapping) and "taxels" in given and set(given) <= {"taxels", "shift"}:
        given = (given["taxels"], given.get("shift", 0))
    if not isinstance(given, Sequence) or isinstance(given, str) or len(given) != 2:
        raise InputError(f'receptive_fields[{number}] must be like {{"taxels": [0, 1], "shift": 1}}, not {given!r}')
    listed, shift = given
    if not isinstance(listed, Sequence) or not all(type(taxel) is int for taxel in listed):
        raise InputError(f"the taxels of receptive_fields[{number}] must be a list of whole numbers, not {listed!r}")
    if len(listed) > MAX_TAXELS:
        raise InputError(f"receptive_fields[{number}] must have at most {MAX_TAXELS} taxels, not {len(listed)}")
    for taxel in listed:
        if not 0 <= taxel < taxels:
            raise InputError(f"the taxels of receptive_fields[{number}] must be in 0..{taxels - 1}, not {taxel}")
    most = most_shift(len(listed))
    if type(shift) is not int or not 0 <= shift <= most:
        raise InputError(
            f"the shift of receptive_fields[{number}] must be in 0..{most} for {len(listed)} taxels, not {shift!r}; "
            "a larger one only loses bits"
        )
    return Field(tuple(sorted(listed)), shift)


def most_shift(taxels: int) -> int:
    """Return the largest allowed right shift of a field."""
    return (max(taxels, 1) - 1).bit_length()


def kind(name: str, rows: int, columns: int, taxel: int) -> Field:
    """Return a taxel's field of a named kind.

    ``neighbours`` is the mean of the taxels above, left, right and below; ``both`` is the mean of the own sample and of
    ``neighbours``. At an edge the own sample replaces a missing neighbour, so that every field has gain 1.
    """
    if name == "own":
        return Field((taxel,))
    row, column = divmod(taxel, columns)
    around = [(row - 1, column), (row, column - 1), (row, column + 1), (row + 1, column)]
    found = [y * columns + x if 0 <= y < rows and 0 <= x < columns else taxel for y, x in around]
    if name == "neighbours":
        return Field(tuple(sorted(found)), 2)
    return Field(tuple(sorted(found + [taxel] * 4)), 3)


def fields_of(config: ReadoutConfig) -> tuple[Field, ...]:
    """Return the field of every taxel after reset."""
    if isinstance(config.receptive_fields, str):
        name = "own" if config.receptive_fields == SETTABLE else config.receptive_fields
        return tuple(kind(name, config.rows, config.columns, taxel) for taxel in range(config.taxels))
    return config.receptive_fields


def is_off(config: ReadoutConfig) -> NDArray[np.bool_]:
    """Return for every taxel whether the taxel is off, shape (taxels,)."""
    if isinstance(config.receptive_fields, str):
        return np.zeros(config.taxels, np.bool_)
    return np.array([not field.taxels for field in config.receptive_fields])


def unused(config: ReadoutConfig) -> set[int]:
    """Return the taxels that belong to no field."""
    return set(range(config.taxels)) - {taxel for field in fields_of(config) for taxel in field.taxels}


def signals(config: ReadoutConfig, samples: NDArray[Any], scale: int | None = None) -> NDArray[Any]:
    """Return the inputs of the encoders: the sum of each field, shifted right, rounded and saturated.

    The result has the shape (ticks, taxels) and the type of ``samples``. Signals saturate at ``scale`` codes, by
    default full scale. For ``receptive_fields="own"`` the samples themselves are returned.
    """
    if config.receptive_fields in ("own", SETTABLE):
        return samples
    return _weighted(fields_of(config), samples, config.full_scale if scale is None else scale)


def chosen(config: ReadoutConfig, samples: NDArray[Any], choice: NDArray[np.integer]) -> NDArray[Any]:
    """Return the inputs of the encoders for fields chosen by a host; all arrays have the shape (ticks, taxels)."""
    found = [seen(config.replace(receptive_fields=name), samples) for name in KINDS]
    return np.choose(choice, [*found, np.zeros_like(samples)])


def seen(config: ReadoutConfig, samples: NDArray[Any]) -> NDArray[Any]:
    """Return the inputs of the comparators; analog inputs may exceed full scale."""
    return signals(config, samples, config.full_scale * (ANALOG_RANGE if config.frontend == "analog" else 1))


def _weighted(fields: Sequence[Field], samples: NDArray[Any], scale: int) -> NDArray[Any]:
    # The k-th taxel of every field is gathered at once. Sums of 256 words of 26 bits fit 64 bits.
    counted = [sorted(Counter(field.taxels).items()) for field in fields]
    total = np.zeros((len(samples), len(fields)), np.int64)
    for place in range(max(map(len, counted))):
        taxel, weight = np.array([one[place] if place < len(one) else (0, 0) for one in counted]).T
        total += samples[:, taxel] * weight
    shift = np.array([field.shift for field in fields])
    half_less = (1 << shift >> 1) - (shift > 0)
    odd = (total >> shift & 1) * (shift > 0)
    rounded = (total + half_less + odd) >> shift
    return rounded.clip(-scale, scale - 1).astype(samples.dtype)
