"""Every property has bugs that it notices, and the kept results are those of the properties that stand here."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import pytest

import rtl.arbiter
from flow.formal.engine import solve
from flow.formal.mutants import Mutant, mutants, planted
from flow.formal.plan import Proof, proofs
from flow.formal.run import FEWEST_MUTANTS, judge, outcomes

ROOT = Path(__file__).parents[2]
PROOFS = proofs()
BLOCKS = sorted({proof.block for proof in PROOFS})
PROPERTIES = {(proof.block, item.name) for proof in PROOFS for item in proof.checker.properties}


@pytest.mark.parametrize("block", BLOCKS)
def test_planted_bugs_fit_the_rtl_and_every_property_has_its_own(block: str) -> None:
    count: Counter[str] = Counter()
    for mutant in mutants(block):
        assert mutant.source() != Path(str(rtl.arbiter.__file__)).read_text()
        assert mutant.fails, mutant.name
        count.update(mutant.fails)
    names = {name for of, name in PROPERTIES if of == block}
    assert set(count) == names
    assert min(count.values()) >= FEWEST_MUTANTS
    assert any(proof.hunts for proof in PROOFS if proof.block == block)


def test_a_bug_is_planted_noticed_and_gone() -> None:
    proof = next(p for p in PROOFS if p.block == "arbiter" and p.hunts)
    (mutant,) = (m for m in mutants("arbiter") if m.name == "pointer does not rotate")
    before = rtl.arbiter.Arbiter
    with planted(mutant):
        assert rtl.arbiter.Arbiter is not before
        verdict = solve(proof.checker(proof.config), proof.depth)
    assert rtl.arbiter.Arbiter is before
    assert set(verdict.failed) == set(mutant.fails)
    assert not verdict.proved & set(verdict.failed)


def test_a_bug_that_no_longer_fits_is_refused() -> None:
    with pytest.raises(ValueError, match=r"mutant 'old': 'no such line' stands 0 times in link\.py"):
        Mutant("old", "link", "no such line", "").source()


def test_a_property_that_misses_a_bug_or_has_too_few_is_a_failure() -> None:
    proof = Proof(PROOFS[0].checker, PROOFS[0].config, 1)
    results = outcomes([(proof, solve(proof.checker(proof.config), 3))], whole=False)
    noticed = Mutant("noticed", "arbiter", "", "", ("no_bubble", "idle_grants"))
    judge(results, [(noticed, {"no_bubble"})])
    problems = {outcome.property.name: outcome.problems for outcome in results}
    assert problems["no_bubble"] == ["only 1 planted bugs show that it can fail"]
    assert problems["idle_grants"] == ["holds although noticed", "only 0 planted bugs show that it can fail"]


def test_the_kept_results_are_those_of_the_properties() -> None:
    kept = json.loads((ROOT / "docs/data/verification/formal.json").read_text())
    assert {(row["block"], row["property"]) for row in kept["properties"]} == PROPERTIES
    assert kept["result"] == f"proved: {len(PROPERTIES)} properties, {len(PROPERTIES)} of them unbounded, 0 failed"
    sizes = {(proof.block, proof.size) for proof in PROOFS}
    assert {(row["block"], size) for row in kept["properties"] for size in row["sizes"]} == sizes
    for row in kept["properties"]:
        assert row["first_seen"] is not None
        own = [mutant.name for mutant in mutants(row["block"]) if row["property"] in mutant.fails]
        assert row["mutants_caught"] == own, row["property"]
