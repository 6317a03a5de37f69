"""Test numbers as text."""

from __future__ import annotations

import pytest

from eskin.base.units import counted


@pytest.mark.parametrize(("number", "text"), [(0, "0 clocks"), (1, "1 clock"), (2, "2 clocks")])
def test_a_noun_follows_its_number(number: int, text: str) -> None:
    assert counted(number, "clock") == text
