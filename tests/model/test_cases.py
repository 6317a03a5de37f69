"""Test that plans get every legal configuration, and that an encoder which refuses values breaks none of them."""

import dataclasses
import itertools
from typing import Any

import pytest
from hypothesis import Phase, find, given, settings

from eskin.base.errors import InputError
from eskin.model.cases import (
    ARRAYS,
    AXES,
    CHOICES,
    LISTED,
    NUMBERS,
    axes,
    cases,
    configurations,
    count,
    pairs,
    singles,
    values_of,
)
from eskin.model.config import NO_LOGIC, ReadoutConfig
from eskin.model.encoders.lcs import Lcs


def test_every_field_with_logic_has_values() -> None:
    assert {*CHOICES, *NUMBERS, *NO_LOGIC, "reference_reset"} == {f.name for f in dataclasses.fields(ReadoutConfig)}


def test_cases_are_all_legal_combinations_in_order() -> None:
    found = [(c.encoding, c.link, c.rows) for c in cases(**axes("encoding", "link"), array=ARRAYS[:2])]
    unipolar = [name for name in CHOICES["encoding"] if not ReadoutConfig(encoding=name).has_polarity]  # type: ignore[arg-type]
    assert unipolar == ["nlcs"]
    assert found == [
        (encoding, link, rows)
        for encoding, link, rows in itertools.product(CHOICES["encoding"], CHOICES["link"], (1, 2))
        if (encoding, link) != ("nlcs", "four_phase_dual")
    ]


def test_a_plan_without_a_legal_case_is_refused() -> None:
    with pytest.raises(InputError, match=r"^encoding must be one of lcs, "):
        list(cases(encoding=("pcm",)))


def meeting(configs: list[ReadoutConfig]) -> set[Any]:
    """Return all values that meet, by the names of their fields."""
    return {pair for config in configs for pair in itertools.combinations(values_of(config).items(), 2)}


def test_any_two_values_that_can_meet_do_meet_in_few_cases() -> None:
    few, every = pairs(**AXES), list(cases(**AXES))
    assert meeting(few) == meeting(every)
    assert len(few) < len(every) / 100
    assert all(count(few)[name][value] for name, values in CHOICES.items() for value in values)
    assert few[0] == every[0]
    once = singles(**AXES)
    assert {value for c in once for value in values_of(c).items()} == {v for c in every for v in values_of(c).items()}
    assert len(once) == len(CHOICES["receptive_fields"])
    assert sorted(c.link for c in pairs(**axes("link"))) == sorted(CHOICES["link"])  # a single axis


def test_an_encoder_that_refuses_a_front_end_leaves_all_others(monkeypatch: pytest.MonkeyPatch) -> None:
    before = pairs(**AXES)
    monkeypatch.setattr(Lcs, "frontends", ("analog",))
    with pytest.raises(InputError, match=r"^encoding lcs needs frontend analog, not digital$"):
        ReadoutConfig()
    after = pairs(ReadoutConfig(encoding="nlcs"), **AXES)
    gone = {pair for pair in meeting(before) - meeting(after) if pair[0][0] == "encoding"}
    assert gone == {(("encoding", "lcs"), ("frontend", "digital"))}
    found = find(configurations(), lambda config: config.encoding == "lcs", settings=settings(database=None))
    assert found.frontend == "analog"


@settings(max_examples=20)
@given(configurations(most_taxels=12, link=["four_phase"], sample_bits=range(3, 8)))
def test_configurations_keep_what_is_given(config: ReadoutConfig) -> None:
    assert config.taxels <= 12
    assert config.link == "four_phase"
    assert 3 <= config.sample_bits <= 7


def test_every_value_of_every_choice_is_drawn() -> None:
    rules = settings(database=None, max_examples=1000, phases=[Phase.generate])
    missing = {(name, value) for name, values in CHOICES.items() for value in values}

    def all_found(config: ReadoutConfig) -> bool:
        missing.difference_update(values_of(config).items())
        return not missing

    find(configurations(), all_found, settings=rules)


def test_a_drawn_configuration_shrinks_to_the_simplest() -> None:
    found = find(configurations(), lambda config: config.rows > 2, settings=settings(database=None))
    simplest = {"rows": 3, "columns": 1, "sample_bits": 3, "resolution": 1, "closing_shift": 0, "window_period": 1}
    simplest |= {"leak_shift": 1, "leak_period": 1, "fraction_bits": 0}
    assert found == ReadoutConfig.from_dict(simplest)


def test_counts_name_every_value_once() -> None:
    configs = list(cases(receptive_fields=("own", LISTED), array=ARRAYS))
    found = count(configs)
    assert found["rows"] == {"1": 2, "2": 2, "5": 2, ">8": 2}
    assert found["receptive_fields"] == {"own": 4, "neighbours": 0, "both": 0, "settable": 0, LISTED: 4}
    assert found["encoding"] == {"lcs": 8, "cw-lcs": 0, "nlcs": 0, "nlcs-bipolar": 0}
