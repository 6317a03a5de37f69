"""Test that make check covers every block and command, and names only existing tests."""

import re
from functools import cache
from pathlib import Path

import pytest

from eskin.app.catalogue import COMMANDS
from tests.quick import LONG, long_first

ROOT = Path(__file__).parents[1]

pytestmark = pytest.mark.quick


def marks(name: str) -> list[str]:
    """Return the arguments of all markers of a name in the tests, as text."""
    files = [path for folder in ("tests", "cocotb_tests") for path in (ROOT / folder).rglob("test_*.py")]
    pattern = re.compile(rf"^@pytest.mark.{name}\(([^)]*)\)", re.MULTILINE)
    return [text for path in files for text in pattern.findall(path.read_text())]


def test_every_block_has_a_quick_test() -> None:
    blocks = sorted(path.stem for path in (ROOT / "rtl").glob("*.py") if not path.stem.startswith("__"))
    assert sorted(re.findall(r'block="(.+?)"', "".join(marks("representative")))) == blocks


def test_every_command_has_a_quick_test() -> None:
    assert sorted(re.findall(r'"(.+?)"', "".join(marks("command")))) == sorted(COMMANDS)


@cache
def functions_of(path: str) -> list[str]:
    return re.findall(r"^(?:async )?def (test_\w+)", (ROOT / path).read_text(), re.MULTILINE)


@pytest.mark.parametrize("entry", LONG)
def test_every_entry_names_a_test(entry: str) -> None:
    path, _, function = entry.partition("[")[0].partition("::")
    assert any(name.startswith(function) for name in functions_of(path)), entry


def test_a_representative_names_cases_and_of_each_the_first_is_quick(request: pytest.FixtureRequest) -> None:
    functions: dict[str, list[pytest.Item]] = {}
    for item in request.session.items:
        functions.setdefault(item.nodeid.partition("[")[0], []).append(item)
    for function, items in functions.items():
        mark = items[0].get_closest_marker("representative")
        for word in mark.args or ("",) if mark and len(items) > 1 else ():
            cases = [item for item in items if item.nodeid.partition("[")[2].startswith(word)]
            assert cases, f"no case of {function} begins with {word}"
            assert cases[0].get_closest_marker("quick")


@pytest.mark.parametrize("workers", [1, 2, 3, 7])
def test_every_worker_begins_with_a_long_test_and_no_test_is_lost(workers: int) -> None:
    nodes = [f"tests/test_a.py::test_{n}" for n in range(40)] + [f"{entry.partition('[')[0]}_0" for entry in LONG]
    order = long_first(nodes, workers)
    assert sorted(order) == list(range(len(nodes)))
    blocks = [order[len(nodes) * k // workers :] for k in range(workers)] if workers in (1, 2) else [order]
    assert all(block[0] >= 40 for block in blocks)
    assert order[0] == 40
