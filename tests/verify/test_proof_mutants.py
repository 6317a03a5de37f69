"""Test that every property fails for a generated mutant, and that stored results are current."""

import json
from collections import Counter
from pathlib import Path

import pytest

from eskin.base.workers.engine import Local
from eskin.base.workers.store import Store
from eskin.verify.proofs import run
from eskin.verify.proofs.bench import rtlil_of
from eskin.verify.proofs.engine import solve
from eskin.verify.proofs.mutants import is_equivalent, mutants
from eskin.verify.proofs.plan import proofs
from eskin.verify.proofs.run import FEWEST_MUTANTS, MutantRun, hunts, judge, outcomes, write

ROOT = Path(__file__).parents[2]
PROOFS = proofs()
PROPERTIES = {(proof.block, name) for proof in PROOFS for name in proof.checker.properties}
LINK = next(proof for proof in PROOFS if proof.block == "link" and proof.hunts)


def test_every_property_applies_where_mutants_are_searched() -> None:
    hunted = {(p.block, name) for p in PROOFS if p.hunts for name in p.checker(p.config).proved}
    assert hunted == PROPERTIES


@pytest.mark.parametrize(
    ("only", "fails"),
    [
        ("-mode const0 -wire aer_req", {"one_at_a_time", "one_pulse_per_event"}),
        ("-mode inv -wire event_ready -port Y", {"one_at_a_time", "ready_answers_ack", "ack_is_synchronised"}),
    ],
)
def test_a_mutant_of_the_link_is_noticed_by_the_properties_on_what_it_breaks(only: str, fails: set[str]) -> None:
    checker = LINK.checker(LINK.config)
    (mutant,) = mutants(checker, 1, 0, f"-module eskin_link {only}")
    assert mutant.rtlil != rtlil_of(checker.block(LINK.config))
    assert set(solve(checker, LINK.depth, 0, mutant.rtlil).failed) >= fails
    assert solve(checker, LINK.depth, 0).failed == {}


def test_a_mutant_of_a_block_without_registers_is_noticed() -> None:
    proof = next(proof for proof in PROOFS if proof.block == "fields" and proof.hunts)
    checker = proof.checker(proof.config)
    (mutant,) = mutants(checker, 1, 0)
    assert solve(checker, proof.depth, 0, mutant.rtlil, cases=False).failed


@pytest.mark.parametrize(
    ("only", "fails"),
    [
        ("-mode inv -wire fires", {"added_when_owed", "none_left_out", "spike_counted"}),  # SumsChecker looks at sums
        ("-mode const0 -wire neurons_read_valid", {"neuron_exact"}),  # the word of another neuron
        ("-mode const1 -wire best -port Q", set()),  # of one class, which is always the best
    ],
)
def test_a_mutant_of_a_stack_is_judged_by_both_checkers_or_is_equivalent(only: str, fails: set[str]) -> None:
    proof = next(proof for proof in PROOFS if proof.hunts and len(getattr(proof.config, "layers", ())) > 1)
    checker = proof.checker(proof.config)
    (mutant,) = mutants(checker, 1, 0, f"-module eskin_classifier {only}")
    assert fails <= set(run.failures(proof, mutant.rtlil, 14))
    assert is_equivalent(checker, mutant) == (not fails)


def test_a_seed_draws_the_same_mutants_again_and_none_of_a_clock() -> None:
    checker = LINK.checker(LINK.config)
    first, again, other = (mutants(checker, 12, seed) for seed in (0, 0, 1))
    assert first == again
    assert {one.name for one in first} != {one.name for one in other}
    assert len({one.rtlil for one in first}) == len(first) >= 10
    assert mutants(checker, 2, 0, "-port CLK") == []


def test_more_are_drawn_until_every_property_has_its_mutants_and_a_stopped_search_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = LINK.checker(LINK.config).proved
    asked = []

    def fake(proof: object, seed: int) -> MutantRun:
        asked.append(seed)
        failed = names if seed == 2 else names[1:]
        return MutantRun("link", LINK.size, seed, {f"{seed} {number}": failed for number in range(FEWEST_MUTANTS)})

    monkeypatch.setattr(run, "hunt", fake)
    out = tmp_path / "found.json"
    found = list(hunts([LINK], Local(1), Store(out, "code")))
    assert [one.seed for one in found] == asked == [0, 1, 2]
    assert list(hunts([LINK], Local(1), Store(out, "code"))) == found
    assert asked == [0, 1, 2]
    monkeypatch.setattr(run, "MAX_DRAWS", 2)
    assert len(list(hunts([LINK], Local(1), Store(out, "other code")))) == 2


def test_a_property_that_too_few_mutants_break_is_a_failure() -> None:
    results = outcomes([(LINK, solve(LINK.checker(LINK.config), LINK.depth))], whole=False)
    names = [outcome.name for outcome in results]
    kills = {f"mutant {number}": names[: 1 if number else None] for number in range(FEWEST_MUTANTS)}
    judge(results, [MutantRun("link", LINK.size, 0, kills | {"survivor": []})])
    assert results[0].problems == []
    assert results[0].mutants == FEWEST_MUTANTS
    assert all(outcome.problems == ["fails by only 1 of 4 generated mutants"] for outcome in results[1:])


def test_one_block_again_keeps_the_results_of_the_others(tmp_path: Path) -> None:
    path = tmp_path / "formal.json"
    proof = next(proof for proof in PROOFS if proof.block == "relay" and proof.small)
    of = {p.block: outcomes([(p, solve(p.checker(p.config), p.depth))], whole=False) for p in (LINK, proof)}
    hunted = [MutantRun(block, "any", 0, {"mutant": ["in_order"], "survivor": []}) for block in of]
    write([*of["link"], *of["relay"]], hunted, path, "make formal")
    whole = json.loads(path.read_text())
    of["link"][0].problems.append("fails")
    write(of["link"], [], path, "make formal BLOCK=link", "link")
    found = json.loads(path.read_text())
    assert [row["property"] for row in found["properties"]] == [row["property"] for row in whole["properties"]]
    assert [one["block"] for one in found["hunts"]] == ["relay"]
    assert found["hunts"][0]["mutants"] == {"mutant": "in_order", "survivor": ""}
    assert found["hunts"][0]["equivalent"] == []
    assert found["result"] == "proved: 15 properties, 15 of them unbounded, 1 failed"


def test_the_recorded_results_are_those_of_the_properties() -> None:
    kept = json.loads((ROOT / "docs/data/verification/formal.json").read_text())
    assert {(row["block"], row["property"]) for row in kept["properties"]} == PROPERTIES
    assert kept["result"] == f"proved: {len(PROPERTIES)} properties, {len(PROPERTIES)} of them unbounded, 0 failed"
    sizes = {(proof.block, proof.size) for proof in PROOFS}
    assert {(row["block"], size) for row in kept["properties"] for size in row["sizes"]} == sizes
    count = Counter(
        (one["block"], name)
        for one in kept["hunts"]
        for failed in one["mutants"].values()
        for name in failed.split(", ")
        if name
    )
    for row in kept["properties"]:
        assert row["first_seen"] is not None
        assert row["mutants"] == count[row["block"], row["property"]]
        assert row["mutants"] >= FEWEST_MUTANTS
