"""Test that every plan of tests, proofs and campaigns contains every value of every axis, or says why not."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import pytest

from eskin.cocotb_tests import test_readout, test_taxel
from eskin.cocotb_tests.bench.random_run import RandomRun, runs
from eskin.model.cases import CHOICES, count
from eskin.model.config import ReadoutConfig
from eskin.verify.coverage import plan as coverage
from eskin.verify.faults import plan as faults
from eskin.verify.proofs import plan as proofs
from eskin.verify.soak import search
from tests.flow import test_asic_proof
from tests.rtl import test_clock_gates
from tests.verify import test_delivered

Reasons = dict[tuple[str, str], str]

LATER: Reasons = {("clock gates", "yes"): "the plan of clock gates proves that they change no flop and no output"}
BY_NATURE: Reasons = {("clock gates", "no"): "the plan is about designs with clock gates"}
OUTSIDE: Reasons = {
    **{("link", link): "a taxel has no link" for link in CHOICES["link"][1:]},
    **{
        ("receptive_fields", name): "a taxel gets its signal from them"
        for name in ("neighbours", "both", "settable", "listed")
    },
    **{("rows", rows): "a taxel stands alone" for rows in ("2", "5", ">8")},
}


@dataclass(frozen=True)
class Plan:
    """Configurations of a plan, and the values that the plan leaves out."""

    configs: Iterable[object]
    left_out: Reasons = field(default_factory=dict)
    gated: bool = False

    def missing(self) -> Reasons:
        """Return the values that do not occur, with their reasons; a value without a reason has an empty one."""
        found = count(config for config in self.configs if type(config) is ReadoutConfig)
        found["clock gates"] = {"yes": int(self.gated), "no": int(not self.gated)}  # type: ignore[assignment]
        reasons = {**(BY_NATURE if self.gated else LATER), **self.left_out}
        none = {(axis, value) for axis, values in found.items() for value, times in values.items() if not times}
        return {one: reasons.get(one, "") for one in sorted(none | set(self.left_out))}


def drawn(seed: int) -> list[ReadoutConfig]:
    """Return the configurations of the runs that the soak and other tests draw."""
    found: list[ReadoutConfig] = []

    def collect(run: RandomRun) -> bool:
        found.append(run.config)
        return False

    search(runs(1000), collect, 300, seed)
    return found


PLANS = {
    "readouts": lambda: Plan(test_readout.breadth()),
    "taxels": lambda: Plan(test_taxel.breadth(), OUTSIDE),
    "delivered texts": lambda: Plan(test_delivered.KINDS.values()),
    "random runs": lambda: Plan(drawn(0)),
    "coverage": lambda: Plan([run.config for run in coverage.runs()], coverage.LEFT_OUT),
    "faults": lambda: Plan([trial.config for trial in faults.trials()], faults.LEFT_OUT),
    "proofs": lambda: Plan([proof.config for proof in proofs.proofs()]),
    "clock gates": lambda: Plan(test_clock_gates.GATED, gated=True),
    "netlists": lambda: Plan(test_asic_proof.NETLISTS, gated=True),
}


@pytest.mark.parametrize("name", PLANS)
def test_every_plan_contains_every_value_or_says_why_not(name: str) -> None:
    plan = PLANS[name]()
    missing = plan.missing()
    for (axis, value), reason in missing.items():
        print(f"{name}: no {axis} {value}: {reason}")
    assert [one for one, reason in missing.items() if not reason] == []
    present = set(plan.left_out) - set(Plan(plan.configs, {}, plan.gated).missing())
    assert not present, f"{name} contains {present}, in spite of a reason why not"


def test_a_plan_without_a_link_is_found() -> None:
    plan = Plan([config for config in test_readout.breadth() if config.link != "four_phase_dual"])
    assert plan.missing() == {("link", "four_phase_dual"): ""} | LATER
