"""Marks the tests of ``make check`` (tests/quick.py) and brings the long ones to the front (tests/order.py)."""

from __future__ import annotations

import pytest

from tests.order import long_first
from tests.quick import chosen


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    nodes = [item.nodeid for item in items]
    quick = chosen(nodes)
    for item in items:
        if item.nodeid in quick:
            item.add_marker(pytest.mark.quick)
    if workers := getattr(config, "workerinput", {}).get("workercount"):
        items[:] = [items[place] for place in long_first(nodes, workers)]
