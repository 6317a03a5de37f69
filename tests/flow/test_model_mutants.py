"""Mutants of model/ and snn/: what counts as an edit, a sample that is the same again, tests that run in forks."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from flow.mutants.argued import argue, arguments
from flow.mutants.judge import Finding
from flow.mutants.model import edits, forks, sampled
from flow.mutants.model.edits import Edit, meaning
from flow.mutants.model.grounds import TESTS
from model.errors import InputError

ROOT = Path(__file__).parents[2]


class Swap:
    """Writes - for +, as an operator of Cosmic Ray does; a node here is a place of the text."""

    @staticmethod
    def mutation_positions(node: tuple[str, int]) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
        text, at = node
        if text[at] == "+":
            line, column = text.count("\n", 0, at) + 1, at - text.rfind("\n", 0, at) - 1
            yield (line, column), (line, column + 1)


def swapped(text: str, operator: object, number: int) -> str:
    places = [place for place, sign in enumerate(text) if sign == "+"]
    return f"{text[: places[number]]}-{text[places[number] + 1 :]}"


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    tools = SimpleNamespace(
        get_ast=str,
        ast_nodes=lambda text: [(text, at) for at in range(len(text))],
        operator_names=lambda: ["core/Swap", "core/RemoveDecorator"],
        get_operator=lambda name: Swap,
        mutate_code=swapped,
    )
    monkeypatch.setattr(edits, "_tools", lambda: tools)
    monkeypatch.setattr(edits, "ROOT", tmp_path)
    (tmp_path / "sums.py").write_text("def f(x: 1 + 1):\n" + "".join(f"    x = x + {n}\n" for n in range(9)))
    edits.places.cache_clear()
    return "sums.py"


def test_a_sample_has_one_edit_from_each_stretch_and_is_the_same_again(file: str) -> None:
    every, count = edits.sample(file, 1.0, 1, seed=1)
    assert count == 10
    assert [edit.line for edit in every] == list(range(2, 11)), "an annotation is no edit"
    assert every[0].name == "sums.py:2: x = x + 0 -> x = x - 0"
    some, _ = edits.sample(file, 0.5, 1, seed=1)
    assert some == edits.sample(file, 0.5, 1, seed=1)[0]
    assert [(edit.line - 1) // 2 for edit in some] == list(range(5))
    assert len({tuple(edits.sample(file, 0.5, 1, seed)[0]) for seed in range(8)}) > 1


def test_what_is_only_said_of_a_program_is_no_change_of_it() -> None:
    text = "@njit(cache=True)\ndef f(x: int | None, y: int = 1) -> int:\n    z: int = 2\n    return z\n"
    for old, new in (("cache=True", "cache=False"), ("int | None", "int & None"), ("-> int", "-> str")):
        assert meaning(text.replace(old, new)) == meaning(text)
    for old, new in (("y: int = 1", "y: int = 2"), ("z: int = 2", "z: int = 3")):
        assert meaning(text.replace(old, new)) != meaning(text)


def test_without_cosmic_ray_one_sentence_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cosmic_ray.ast", None)
    edits._tools.cache_clear()
    with pytest.raises(InputError, match="cosmic-ray is not installed; run make mutants MODEL=1"):
        edits._tools()


def test_every_file_and_its_tests_are_there() -> None:
    for file, tests in TESTS.items():
        assert (ROOT / file).is_file(), file
        for test in tests:
            path, _, function = test.partition("[")[0].partition("::")
            assert f"def {function}" in (ROOT / path).read_text(), test


def edit_of(text: str) -> Edit:
    return Edit("model/link.py", "Swap", 1, "old", text, text)


@pytest.fixture
def asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return what was in the file each time when tests were asked; those of "bad" fail."""
    texts: list[str] = []
    (tmp_path / "model").mkdir()
    (tmp_path / "model/link.py").write_text("good")

    @contextmanager
    def copy() -> Iterator[tuple[Path, Any]]:
        def ask(tests: tuple[str, ...]) -> tuple[int, str]:
            texts.append((tmp_path / "model/link.py").read_text())
            return (1, tests[0]) if texts[-1].startswith("bad") else (0, "")

        yield tmp_path, ask

    monkeypatch.setattr(sampled, "_copy", copy)
    return texts


def test_a_stopped_campaign_goes_on_and_the_file_is_as_before(tmp_path: Path, asked: list[str]) -> None:
    told: list[Finding] = []
    picked = [edit_of("bad 1"), edit_of("like it"), edit_of("bad 2")]
    sampled.judge(picked[:2], tmp_path, False, told.append)
    found = sampled.judge(picked, tmp_path, False, told.append)
    files = len(TESTS["model/link.py"])  # each is asked once whether it passes without an edit
    assert asked == ["good"] * files + ["bad 1", "like it", "bad 2"]
    assert [one.verdict for one in found] == [one.verdict for one in told] == ["killed", "alive", "killed"]
    assert found[0].by == "tests/model/test_link.py"
    assert sampled.judge([*picked, edit_of("bad 3")], tmp_path, False, told.append, judging=False) == found
    sampled.judge(picked, tmp_path, True, told.append)
    assert asked[files + 3 :] == ["like it"]
    assert (tmp_path / "model/link.py").read_text() == "good"
    kept = sampled.summary(found, 4, {"model/link.py": 40})
    assert (kept["total"], kept["killed"], kept["survivors"][0]["name"]) == (3, 2, "model/link.py:1: old -> like it")
    assert kept["result"] == (
        "mutants of model and snn: 3, 0 argued to be equivalent; of the others 2 killed (66.7 %, 95 % interval 20.8 to "
        "93.9 %); 1 alive, 1 not yet judged"
    )


def test_tests_that_fail_without_an_edit_say_nothing(tmp_path: Path, asked: list[str]) -> None:
    (tmp_path / "model/link.py").write_text("bad")
    with pytest.raises(RuntimeError, match=r"the tests of model/link\.py fail without an edit"):
        sampled.judge([edit_of("bad 1")], tmp_path, False, lambda finding: None)


def test_a_fork_runs_tests_to_the_first_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "test_it.py").write_text(
        "def test_good(): pass\ndef test_bad(): assert 0\ndef test_worse(): assert 0\n"
    )
    assert forks._run(["test_it.py"]) == {"code": 1, "failed": "test_it.py::test_bad"}
    assert forks._run(["test_it.py::test_good"]) == {"code": 0, "failed": ""}


def test_a_test_that_hangs_ends_long_before_all_may(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(forks, "TEST_S", 1)
    (tmp_path / "test_it.py").write_text("def test_good(): pass\ndef test_endless():\n    while True: pass\n")
    assert forks._run(["test_it.py"])["code"] == -signal.SIGXCPU


def test_what_takes_too_long_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forks, "WALL_S", 0.1)
    child = os.fork()
    if not child:
        os.setsid()
        time.sleep(60)
        os._exit(0)
    assert forks._ended(child) == -signal.SIGKILL


def test_arguments_are_of_lines_that_stand_there(monkeypatch: pytest.MonkeyPatch) -> None:
    assert all(len(why) > 40 for why in arguments().values())
    line = (ROOT / "rtl/link.py").read_text().splitlines()[0].strip()
    monkeypatch.setattr("flow.mutants.argued.arguments", lambda: {("rtl/link.py", line, "a -> b"): "because"})
    findings = [
        Finding("", name, "", "", "", verdict)
        for name, verdict in (
            ("link.py:1: a -> b", "alive"),
            ("link.py:2: a -> b", "alive"),
            ("link.py:1: a -> b", "killed"),
        )
    ]
    argue(findings)
    assert [one.verdict for one in findings] == ["argued", "alive", "killed"]
