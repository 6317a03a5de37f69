"""Choice of the tests of ``make check``, and order of all tests."""

from collections.abc import Sequence

import pytest


def chosen(items: Sequence[pytest.Item]) -> list[pytest.Item]:
    """Return the tests that markers choose, and the first test of each command.

    A marker ``representative`` chooses the first case whose name begins with each of its words; without words, the
    first case.
    """
    found: list[pytest.Item] = []
    seen = set()
    for item in items:
        function, _, case = item.nodeid.partition("[")
        for mark in item.iter_markers("representative"):
            for word in mark.args or ("",):
                if case.startswith(word) and (function, word) not in seen:
                    seen.add((function, word))
                    found.append(item)
        for mark in item.iter_markers("command"):
            if mark.args not in seen:
                seen.add(mark.args)
                found.append(item)
    return found


def fits(node: str, entry: str) -> bool:
    """Return True if an entry of ``LONG`` is the beginning of a test's name."""
    function, bracket, case = entry.partition("[")
    return node.startswith(function) and (not bracket or node.partition("[")[2].startswith(case))


LONG = (
    "tests/independent/test_agreement.py::test_skins_of_tiles",
    "tests/docs/test_site.py::test_the_site",
    "tests/independent/test_agreement.py::test_both_give_the_same_events",
    "tests/test_wheel.py::test_commands_work_elsewhere",
    "tests/docs/test_tutorial.py::test_the_page_shows",
    "tests/test_install.py::test_every_group_resolves",
    "tests/board/test_gateware.py::test_a_recording",
    "tests/board/test_gateware.py::test_the_classes",
    "tests/verify/test_coverage.py::test_a_dead_line",
    "tests/board/test_demo.py::test_the_page",
    "tests/snn/test_train.py::test_a_killed_command",
    "tests/snn/test_sweep.py::test_a_sweep_outlives",
    "tests/app/test_simulate.py::test_replay",
    "tests/verify/test_coverage.py::test_small_runs",
    "tests/board/test_gateware.py::test_a_foreign_chip",
    "cocotb_tests/test_readout.py::test_verilator_sees_the_same",
)
"""Those of five seconds and more; a function, or the beginning of a case's name.

The first of two workers begins with the tests that compile the model for every encoder, the second one with tests that
do not need it: else both would compile it.
"""


def long_first(nodes: Sequence[str], workers: int) -> list[int]:
    """Return the indices of the tests with these names in order of execution.

    ``--dist worksteal`` gives every worker a block of equal size to begin with; who is done first takes from the end
    of another's.
    """
    long = list(dict.fromkeys(place for entry in LONG for place, node in enumerate(nodes) if fits(node, entry)))
    short = sorted({*range(len(nodes))} - {*long})
    order: list[int] = []
    for worker in range(workers):
        block = long[worker::workers]
        room = max((len(nodes) - len(order)) // (workers - worker) - len(block), 0)
        order += block + short[:room]
        short = short[room:]
    return order
