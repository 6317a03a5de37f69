"""Test that the proofs hold, and that empty, wrong or missing properties fail."""

from typing import Any, ClassVar

import pytest
from amaranth.asserts import AnyConst
from amaranth.hdl import Fragment, Module, Signal

from eskin.model.config import ReadoutConfig
from eskin.rtl.links.four_phase import FourPhaseLink
from eskin.verify.proofs.blocks.link import LinkChecker
from eskin.verify.proofs.checker import Checker, Promises
from eskin.verify.proofs.engine import Verdict, solve
from eskin.verify.proofs.plan import Proof, proofs
from eskin.verify.proofs.run import closing_line, outcomes
from tests.conftest import command

SMALL = [proof for proof in proofs() if proof.small]
CONFIG = ReadoutConfig(rows=1, columns=1, link="four_phase")


@pytest.mark.command("formal")
def test_the_command_ends_with_its_one_line(call: Any) -> None:
    code, out, error = call("dev formal --block link --small")
    assert code == 0, error
    assert out.splitlines()[-1] == "proved: 10 properties, 10 of them unbounded, 0 failed"


@pytest.mark.representative("window", "registers", "host")
@pytest.mark.parametrize("proof", [p for p in SMALL if p.block != "link"], ids=lambda proof: proof.block)
def test_a_small_block_keeps_every_property(proof: Proof) -> None:
    verdict = solve(proof.checker(proof.config), proof.depth)
    results = outcomes([(proof, verdict)], whole=False)
    assert len(results) >= 3
    assert [outcome.problems for outcome in results if outcome.problems] == []


def test_every_block_is_proved_in_a_small_configuration_too() -> None:
    assert {proof.block for proof in SMALL} == {proof.block for proof in proofs()}
    (block,) = (option for option in command("formal").params if option.name == "block")
    assert set(block.help.removeprefix("only this block: ").split(", ")) == {proof.block for proof in proofs()}


class _Claims(Checker[ReadoutConfig]):
    """Properties for tests: true, false late, without a case, and with a free constant."""

    block = FourPhaseLink
    properties: ClassVar = {
        "true": "holds",
        "late": "fails when REQ rises, four clocks after reset at the earliest",
        "empty": "speaks of what never happens",
        "constant": "a free constant keeps its value",
    }

    def check(self, m: Module) -> Promises:
        anything = AnyConst(2)
        first = Signal(2)
        started = Signal()
        m.d.sync += started.eq(1)
        with m.If(~started):
            m.d.sync += first.eq(anything)
        yield "true", 1, self.aer_req
        yield "late", ~self.aer_req, self.aer_req
        yield "empty", 1, 0
        yield "constant", ~started | (first == anything), started & (anything == 2)


def test_a_false_and_an_empty_claim_are_failures() -> None:
    checker = _Claims(CONFIG)
    verdict = solve(checker, 8)
    assert verdict.proved == {"true", "empty", "constant"}
    assert verdict.failed == {"late": 4}
    assert set(verdict.reached) == {"true", "late", "constant"}
    results = outcomes([(Proof(_Claims, CONFIG, 8), verdict)])
    assert {o.name for o in results if o.problems} == {"late", "empty"}
    assert (
        closing_line([outcome.problems for outcome in results]) == "proved: 2 properties, 2 of them unbounded, 2 failed"
    )


def test_a_property_that_no_proof_has_or_that_ran_out_of_time_is_a_failure() -> None:
    proof = Proof(LinkChecker, ReadoutConfig(rows=1, columns=1, encoding="nlcs", link="four_phase"), 8)
    names = set(proof.checker(proof.config).proved)
    verdict = Verdict(frozenset(names - {"one_at_a_time"}), {}, dict.fromkeys(names, 1), 8, 1.0)
    failed = {o.name: o.problems for o in outcomes([(proof, verdict)]) if o.problems}
    assert failed == {
        "one_at_a_time": ["1 x 1 unipolar: not proved"],
        "address_of_event": ["no proof has it"],
        "address_stable": ["no proof has it"],
        "request_of_polarity": ["no proof has it"],
    }


class _Silent(LinkChecker):
    """Checker that defines none of its properties, and not its assumption."""

    def check(self, m: Module) -> Promises:
        Fragment.get(m, None)  # used, for Amaranth
        yield from ()


def test_a_checker_that_leaves_a_property_or_an_assumption_open_is_refused() -> None:
    with pytest.raises(AssertionError, match="_Silent does not define ack_follows_req, ack_is_synchronised, address_"):
        Fragment.get(_Silent(CONFIG), None)
