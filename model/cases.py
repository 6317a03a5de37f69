"""Legal configurations of a readout: plans of tests, proofs and campaigns take their configurations from here.

A combination of values is illegal only where ``ReadoutConfig`` refuses it, so a new encoder, front end or link is in
every plan as soon as ``ReadoutConfig`` knows it.
"""

from __future__ import annotations

import contextlib
import itertools
import random
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, get_args, get_type_hints

import numpy as np

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import KINDS, SETTABLE, most_shift

if TYPE_CHECKING:  # for tests only, so imported by the function that needs it
    from hypothesis import strategies as st

LISTED = "listed"
"""Value of ``receptive_fields``: a list with a receptive field for every taxel."""

_HINTS = {name: get_args(hint) for name, hint in get_type_hints(ReadoutConfig).items()}
CHOICES: dict[str, tuple[str, ...]] = {
    **{name: values for name, values in _HINTS.items() if values and isinstance(values[0], str)},
    "receptive_fields": (*KINDS, SETTABLE, LISTED),
}
"""Fields of ``ReadoutConfig`` with few values, and all of these values."""

ARRAYS = ({"rows": 1, "columns": 3}, {"rows": 2, "columns": 2}, {"rows": 5, "columns": 2}, {"rows": 9, "columns": 1})
"""Small arrays with 1, 2, 5 and more than 8 rows."""

AXES: dict[str, Iterable[Any]] = {**CHOICES, "array": ARRAYS}
"""All axes with the values that every plan contains; a dictionary sets several fields."""

NUMBERS: dict[str, Iterable[int]] = {
    "rows": (1, 2, 3, 4, 5, 7, 8, 9, 16, 33),
    "columns": (1, 2, 3, 4, 5, 7, 8, 16, 33),
    "sample_bits": (3, 4, 5, 6, 8, 12, 16),
    "resolution": range(1, 15),
    "closing_shift": range(6),
    "window_period": (1, 2, 3, 5, 16, 64),
    "leak_shift": range(1, 9),
    "leak_period": (1, 2, 3, 7, 20, 63),
    "fraction_bits": range(11),
}
"""Values that ``configurations`` draws for the other fields with logic, the simplest first."""

EASY = {"rows": 1, "columns": 1, "resolution": 1, "closing_shift": 0, "leak_period": 64, "fraction_bits": 0}
"""Values of fields that allow most values of other fields."""


def axes(*names: str) -> dict[str, Iterable[Any]]:
    """Return all values of the named axes."""
    return {name: AXES[name] for name in names}


def cases(base: ReadoutConfig | None = None, /, **axes: Iterable[Any]) -> Iterator[ReadoutConfig]:
    """Yield the configurations of all legal combinations of values; the last axis changes fastest.

    An axis is a field of ``ReadoutConfig`` with its values, or has any name and dictionaries of fields as values.
    Other fields are those of ``base``.

    Examples
    --------
    >>> [(one.encoding, one.link) for one in cases(encoding=("lcs", "nlcs"), link=("stream", "four_phase_dual"))]
    [('lcs', 'stream'), ('lcs', 'four_phase_dual'), ('nlcs', 'stream')]
    """
    return (_config(fields) for fields, _ in _legal(base, axes))


def pairs(base: ReadoutConfig | None = None, /, **axes: Iterable[Any]) -> list[ReadoutConfig]:
    """Return few of ``cases(base, **axes)``, so that any two values meet that meet in any case.

    The first has the first values of all axes, if this is legal; the order of the others means nothing.

    Examples
    --------
    >>> len(pairs(**AXES)) < 30 < 2000 < len(list(cases(**AXES)))
    True
    """
    return _covering(2, base, axes)


def singles(base: ReadoutConfig | None = None, /, **axes: Iterable[Any]) -> list[ReadoutConfig]:
    """Return few of ``cases(base, **axes)``, so that every value occurs that occurs in any case.

    Examples
    --------
    >>> [config.link for config in singles(**axes("reset", "link"))][:1], len(singles(**axes("reset", "link")))
    (['stream'], 3)
    """
    return _covering(1, base, axes)


def _covering(strength: int, base: ReadoutConfig | None, axes: Mapping[str, Iterable[Any]]) -> list[ReadoutConfig]:
    """Return few cases in which single values (strength 1) or pairs of values (2) occur that occur in any case."""
    legal = list(_legal(base, axes))
    legal[1:] = random.Random(0).sample(legal[1:], len(legal) - 1)  # or the last few would all be alike
    places = np.array([place for _, place in legal])
    sizes = places.max(0, initial=0) + 1
    chosen = [(a, a) for a in range(len(sizes))] + [*itertools.combinations(range(len(sizes)), 2)] * (strength == 2)
    numbers = np.stack([places[:, a] * sizes[b] + places[:, b] for a, b in chosen], axis=1)  # of every pair
    numbers += np.cumsum([0, *(numbers.max(0) + 1)])[:-1]
    missing = np.zeros(numbers.max() + 1, bool)
    missing[numbers] = True
    few = []
    while missing.any():
        best = missing[numbers].sum(axis=1).argmax()
        missing[numbers[best]] = False
        few.append(_config(legal[best][0]))
    return few


def _legal(
    base: ReadoutConfig | None, axes: Mapping[str, Iterable[Any]]
) -> Iterator[tuple[dict[str, Any], tuple[int, ...]]]:
    """Yield the fields of legal combinations, and the place of every value on its axis.

    Raise the last error if there are none.
    """
    listed = [[value if isinstance(value, Mapping) else {name: value} for value in axes[name]] for name in axes]
    fields = base.to_dict() if base else {}
    refused, found = None, False
    for place in itertools.product(*(range(len(values)) for values in listed)):
        chosen = fields | {k: v for values, n in zip(listed, place, strict=True) for k, v in values[n].items()}
        try:  # lists take long to check, and are as legal as other fields
            ReadoutConfig.from_dict(
                chosen | {"receptive_fields": "both"} if chosen.get("receptive_fields") == LISTED else chosen
            )
        except InputError as error:
            refused = error
            continue
        found = True
        yield chosen, place
    if refused and not found:
        raise refused


def _config(fields: dict[str, Any]) -> ReadoutConfig:
    """Return the configuration of fields, with a list in place of ``LISTED``."""
    if fields.get("receptive_fields") == LISTED:
        taxels = ReadoutConfig.from_dict(fields | {"receptive_fields": "both"}).taxels
        fields = fields | {"receptive_fields": _some_fields(taxels)}
    return ReadoutConfig.from_dict(fields)


def _some_fields(taxels: int) -> list[tuple[list[int], int]]:
    """Return a receptive field for every taxel: its own and the next one twice; in a larger array the last is off."""
    listed = [([n, (n + 1) % taxels, (n + 1) % taxels], n % 2) for n in range(taxels)]
    return [*listed[:-1], ([], 0)] if taxels > 2 else listed


def configurations(most_taxels: int = 64, **axes: Iterable[Any]) -> st.SearchStrategy[ReadoutConfig]:
    """Return a Hypothesis strategy over all legal configurations with at most ``most_taxels`` taxels.

    A field has the given values, or those of ``CHOICES`` and ``NUMBERS``; the first value is the simplest. The
    reference begins at any level, and listed receptive fields contain any taxels.
    """
    from hypothesis import strategies as st

    listed: dict[str, list[Any]] = {name: list(values) for name, values in {**CHOICES, **NUMBERS, **axes}.items()}
    # Last, because lists with a field for every taxel take long to check.
    listed["receptive_fields"] = listed.pop("receptive_fields")

    def is_legal(before: dict[str, Any], name: str, value: Any) -> bool:
        """Return True if a value makes a legal configuration with some of the choices that are not drawn yet."""
        chosen = before | {name: value}
        if chosen.get("rows", 1) * chosen.get("columns", 1) > most_taxels:
            return False
        given = {field: [one] for field, one in (EASY | chosen).items()}
        with contextlib.suppress(InputError):
            return any(True for _ in cases(**({field: listed[field] for field in CHOICES} | given)))
        return False

    @st.composite
    def drawn(draw: st.DrawFn) -> ReadoutConfig:
        chosen: dict[str, Any] = {}
        for name, values in listed.items():
            chosen[name] = draw(st.sampled_from(values).filter(partial(is_legal, chosen, name)))
        if chosen["receptive_fields"] == LISTED:
            chosen["receptive_fields"] = draw(_any_fields(chosen["rows"] * chosen["columns"]))
        config = ReadoutConfig.from_dict(chosen)
        if "reference_reset" not in axes:
            levels = st.integers(config.encoder.lowest(config) // config.grid, config.full_scale // config.grid - 1)
            config = config.replace(reference_reset=config.grid * draw(st.just(0) | levels))
        return config

    return drawn()


def _any_fields(taxels: int) -> st.SearchStrategy[list[dict[str, Any]]]:
    """Return a strategy over lists of receptive fields; several taxels are off."""
    from hypothesis import strategies as st

    def field(drawn: tuple[list[int], int]) -> dict[str, Any]:
        return {"taxels": drawn[0], "shift": min(drawn[1], most_shift(len(drawn[0])))}

    some = [st.lists(st.integers(0, taxels - 1), min_size=not n, max_size=6) for n in range(taxels)]
    return st.tuples(*(st.tuples(one, st.integers(0, 2)).map(field) for one in some)).map(list)


def values_of(config: ReadoutConfig) -> dict[str, str]:
    """Return the value of a configuration on every axis; arrays have the number of their rows, at most ">8"."""
    values = {name: getattr(config, name) for name in CHOICES}
    values["receptive_fields"] = values["receptive_fields"] if isinstance(values["receptive_fields"], str) else LISTED
    return values | {"rows": ">8" if config.rows > 8 else str(config.rows)}


def count(configs: Iterable[ReadoutConfig]) -> dict[str, Counter[str]]:
    """Return how often every value of every axis occurs in configurations, also 0."""
    found = {name: Counter(dict.fromkeys(values, 0)) for name, values in CHOICES.items()}
    found["rows"] = Counter({values_of(ReadoutConfig.from_dict(array))["rows"]: 0 for array in ARRAYS})
    for config in configs:
        for name, value in values_of(config).items():
            found[name][value] += 1
    return found
