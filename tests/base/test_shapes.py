"""Test damaged files of the program: an error message, or a new file."""

from pathlib import Path

import pytest

from eskin.base.errors import InputError
from eskin.base.shapes import misfit, read_shaped


@pytest.mark.parametrize(
    ("value", "wrong"),
    [
        ({"a": [{"b": 1.5, "c": None}]}, ""),
        ({"a": []}, ""),
        (None, "it is no object"),
        ({}, "a is missing"),
        ({"a": 5}, "a is no list"),
        ({"a": [None]}, "a[0] is no object"),
        ({"a": [{"b": 1, "c": "x"}, {"b": "1", "c": "x"}]}, "a[1].b is '1'"),
        ({"a": [{"b": True, "c": "x"}]}, "a[0].b is True"),
        ({"a": [{"b": float("inf"), "c": "x"}]}, "a[0].b is inf"),
        ({"a": [{"b": 1, "c": 3}]}, "a[0].c is 3"),
    ],
)
def test_a_value_of_the_wrong_shape_is_named(value: object, wrong: str) -> None:
    assert misfit(value, {"a": [{"b": float, "c": (str, None)}]}) == wrong


def test_numbers_are_counts_where_whole_ones_belong(tmp_path: Path) -> None:
    assert [misfit(value, int) for value in (3, -1, 1.0, True)] == ["", "it is -1", "it is 1.0", "it is True"]
    (tmp_path / "a.json").write_text('{"runs": null}')
    with pytest.raises(InputError, match=r"^the sums .*a.json is damaged: runs is null; remove it$"):
        read_shaped(tmp_path / "a.json", "the sums", {"runs": int})
