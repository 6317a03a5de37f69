"""Test that both solvers agree, and that a difference is a failure."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from eskin.verify.crosscheck import prove, sby
from eskin.verify.proofs.plan import proofs

LINK = next(proof for proof in proofs() if proof.block == "link" and proof.small)


def test_both_find_the_same_first_clocks_of_a_block_and_of_mutants(
    call: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(prove, "MUTANTS", 1)
    code, out, error = call("dev crossproof --block link --small --mutants --out found.json")
    assert code == 0, error
    kept = json.loads((folder / "found.json").read_text())
    line = (
        "crossproof: 19 properties of 2 designs, 2 generated mutants, 2 of them killed; "
        "z3 finds the first clocks that ABC finds, 0 problems"
    )
    assert out.splitlines()[-1] == kept["result"] == line
    whole = [one for one in kept["designs"] if not one["mutant"]]
    changed = [one for one in kept["designs"] if one["mutant"]]
    assert [one["failed"] for one in whole] == [{}, {}]
    assert len(changed) == 2
    assert all(one["mutant"].startswith("-mode ") and one["failed"] for one in changed)


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"failed": {"one_at_a_time": 3}}, "one_at_a_time fails in clock None by ABC, 3 by z3"),
        ({"reached": {}}, "address_stable is seen in clock 1 by ABC, None by z3"),
    ],
)
def test_a_difference_is_a_problem(
    changes: dict[str, Any], problem: str, call: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def wrong(checker: Any, depth: int, rtlil: str = "") -> Any:
        return replace(prove.solve(checker, depth, 0), **changes)

    monkeypatch.setattr(prove, "search", wrong)
    code, out, _ = call("dev crossproof --block link --small")
    assert code == 1
    assert f"PROBLEM: {problem}" in out


def test_an_answer_that_is_missing_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sby, "_ask", lambda text, job: "reached cover statement bench.bad_one_at_a_time_0 at  step 3")
    with pytest.raises(sby.SolverFailed, match="1 answers to 18 questions about eskin_link_properties"):
        sby.search(LINK.checker(LINK.config), LINK.depth)


def test_without_the_solver_there_is_one_sentence(refuses: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sby, "find_spec", lambda name: None)
    refuses("z3-solver is missing; run make crossproof", "dev crossproof --block link --small")
