"""Test that RTL and model agree in random cases, and that a planted bug is found and shrunk."""

import re
import shlex
from typing import Any

import pytest

from eskin.base.errors import InputError
from tests.planted import planted
from tests.random_cases.__main__ import main
from tests.random_cases.case import Case, search

EXAMPLES = 25


def test_rtl_and_model_agree_in_cases_that_no_run_before_has_drawn(holdout: int) -> None:
    found = search(EXAMPLES, holdout)
    assert found.case is None, found.told
    assert found.examples >= EXAMPLES


ONE = {"rows": 1, "columns": 1}
SHRUNK: dict[str, tuple[tuple[str, str, str], int, dict[str, Any], dict[str, Any], int]] = {
    "a step": (
        ("encoders.encoder", "else difference >= half_width", "else difference > half_width"),
        2,
        {"frontend": "digital"},
        ONE | {"encoding": "lcs", "sample_bits": 3, "link": "stream"},
        4,
    ),
    "a mask": (
        ("taxel", "self.request.eq(own.pending & self.enable)", "self.request.eq(own.pending)"),
        11,
        ONE | {"frontend": "digital", "encoding": "lcs", "sample_bits": 3, "link": "stream"},
        {"resolution": 1},
        4,
    ),
    "a link": (
        ("link", "ack_sync.eq(ack_meta)", "ack_sync.eq(self.aer_ack)"),
        2,
        ONE | {"link": "four_phase"},
        {"sample_bits": 3},
        12,
    ),
}
"""Bugs, the seed that finds each soon, what of the configuration is given, what must be left of the rest, and the most
clocks of the smallest case."""


@pytest.mark.parametrize("name", SHRUNK)
def test_a_planted_bug_is_shrunk_to_the_smallest_case(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    (file, old, new), seed, fixed, left, clocks = SHRUNK[name]
    with planted(file, (old, new)):
        found = search(400, seed, **fixed)
        assert found.case is not None
        assert left.items() <= found.case.config.items(), found.told
        assert 0 < found.case.clocks <= clocks, found.told
        again = shlex.split(re.search(r"^reproduce: python -m tests.random_cases (.*)$", found.told, re.MULTILINE)[1])  # type: ignore[index]
        assert "model" in str(main(again))
    assert main(again) == 0  # without the bug
    assert capsys.readouterr().out == "RTL and model agree\n"


def test_a_search_says_its_seed_and_ends_well(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["3", "7"]) == 0
    assert re.fullmatch(
        r"seed 7: \d+ cases, \d+ a second\nRTL and model agree in all of them\n", capsys.readouterr().out
    )


def test_what_is_no_case_is_one_sentence() -> None:
    for words in ([], ["0"], ["x"], ["1", "2", "3"]):
        with pytest.raises(InputError, match=r"usage: python -m tests\.random_cases EXAMPLES"):
            main(words)
    for text in ('{"config": {}', '{"samples": []}', '{"config": {"rows": 1, "columns": 2}, "samples": [[1]]}'):
        with pytest.raises(InputError, match="a case is a line of JSON"):
            Case.from_json(text)
    with pytest.raises(InputError, match="rows must be in"):
        Case.from_json('{"config": {"rows": 0}, "samples": [[1]]}')
