"""Test that make check covers every block and command, and names only existing tests."""

import re
from functools import cache
from pathlib import Path

import pytest

from eskin.app.catalogue import COMMANDS
from tests.quick import BLOCKS, LONG, OTHERS, chosen, fits, long_first

ROOT = Path(__file__).parents[1]


def test_every_block_has_a_quick_test() -> None:
    assert set(BLOCKS) == {path.stem for path in (ROOT / "rtl").glob("*.py") if not path.stem.startswith("__")}


def test_every_command_has_a_quick_test() -> None:
    files = [path for folder in ("tests", "cocotb_tests") for path in (ROOT / folder).rglob("test_*.py")]
    text = "\n".join(path.read_text() for path in files)
    marks = re.findall(r"^@pytest.mark.command\((.*)\)", text, re.MULTILINE)
    assert sorted(name for mark in marks for name in re.findall(r'"(.+?)"', mark)) == sorted(COMMANDS)


@cache
def functions_of(path: str) -> list[str]:
    return re.findall(r"^(?:async )?def (test_\w+)", (ROOT / path).read_text(), re.MULTILINE)


@pytest.mark.parametrize("entry", sorted({*BLOCKS.values(), *OTHERS.values(), *LONG}))
def test_every_entry_names_a_test(entry: str) -> None:
    path, _, function = entry.partition("[")[0].partition("::")
    assert any(name.startswith(function) for name in functions_of(path)), entry


def test_of_a_block_one_case_is_taken(request: pytest.FixtureRequest) -> None:
    arbiter = [f"{BLOCKS['arbiter']}-{n}]" for n in range(3)]
    assert chosen(arbiter) == {arbiter[0]}
    assert chosen(["cocotb_tests/test_arbiter.py::test_arbiter_keeps_its_contract[verilator-3x5-1]"]) == set()
    nodes = [item.nodeid for item in request.session.items]
    for entry in BLOCKS.values():
        cases = [node for node in nodes if fits(node, entry.partition("[")[0])]
        assert len(cases) < 2 or chosen(nodes) & set(cases), f"no case is that of {entry}"


@pytest.mark.parametrize("workers", [1, 2, 3, 7])
def test_every_worker_begins_with_a_long_test_and_no_test_is_lost(workers: int) -> None:
    nodes = [f"tests/test_a.py::test_{n}" for n in range(40)] + [f"{entry.partition('[')[0]}_0" for entry in LONG]
    order = long_first(nodes, workers)
    assert sorted(order) == list(range(len(nodes)))
    blocks = [order[len(nodes) * k // workers :] for k in range(workers)] if workers in (1, 2) else [order]
    assert all(block[0] >= 40 for block in blocks)
    assert order[0] == 40
