"""Marks the tests of ``make check`` (tests/quick.py)."""

from __future__ import annotations

import pytest

from tests.quick import chosen


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    quick = chosen([item.nodeid for item in items])
    for item in items:
        if item.nodeid in quick:
            item.add_marker(pytest.mark.quick)
