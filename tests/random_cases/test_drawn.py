"""Test that RTL and model agree in random runs, and that a planted bug is found and reduced to a small run."""

import functools
from typing import Any

import pytest

from eskin.cocotb_tests.bench.random_run import RandomRun, runs
from eskin.model.events.compare import first_difference
from eskin.model.readout import simulate
from eskin.verify.soak import search
from tests.independent.agreement import strobes_differ
from tests.planted import planted
from tests.random_cases.player import Breach, Design

EXAMPLES = 25
SMALL: dict[str, Any] = {"rows": (1, 2, 3), "columns": (1, 2, 3), "sample_bits": range(3, 8)}


def difference(run: RandomRun, design_of: Any = Design) -> str:
    """Return the first difference between RTL and model, or an empty text."""
    design = design_of(run.config)
    try:
        found = first_difference(simulate(run.config, run.stimulus), design.play(run.stimulus))
    except Breach as breach:
        return f"the RTL breaks the protocol of its link: {breach}"
    if found is None:
        return strobes_differ(run.config, run.stimulus, design.asked)
    return found.describe(("model", "RTL"))


def smallest(examples: int, seed: int, **axes: Any) -> RandomRun | None:
    """Return the smallest random run in which RTL and model differ."""
    design_of = functools.lru_cache(maxsize=30)(Design)  # elaborated once, since shrinking changes the stimulus most
    drawn = runs(clocks=200, noisy=True, **SMALL | axes)
    return search(drawn, lambda run: bool(difference(run, design_of)), examples, seed)


def test_rtl_and_model_agree_in_runs_that_were_never_drawn_before(holdout: int) -> None:
    found = smallest(EXAMPLES, holdout)
    assert found is None, f"{difference(found)}\nreproduce: eskin dev soak --sim icarus --only '{found.to_json()}'"


ONE: dict[str, Any] = {"rows": (1,), "columns": (1,), "registers": ("none",)}  # little to simulate
PLAIN: dict[str, Any] = ONE | {"encoding": ("lcs",), "sample_bits": (3,), "frontend": ("digital",), "link": ("stream",)}
PLANTED: dict[str, tuple[tuple[str, str, str], dict[str, Any], int]] = {
    "a step": (("encoders.encoder", "else difference >= half_width", "else difference > half_width"), ONE, 10),
    "a mask": (
        ("taxel", "self.request.eq(shared.pending & self.enable)", "self.request.eq(shared.pending)"),
        PLAIN,
        100,
    ),
    "a link": (
        ("links.four_phase", "ack_sync.eq(ack_meta)", "ack_sync.eq(self.aer_ack)"),
        ONE | {"link": ("four_phase",)},
        20,
    ),
}
"""Bugs, the given fields, and the largest number of clocks of the smallest run."""


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_bug_is_reduced_to_a_small_run(name: str) -> None:
    (file, old, new), given, clocks = PLANTED[name]
    with planted(file, (old, new)):
        found = smallest(400, 1, **given)
        assert found is not None
        assert "model" in difference(found)
    assert difference(found) == ""
    simplest = {"encoding": "lcs", "sample_bits": 3, "resolution": 1, "reference_reset": 0, "reset": "sync"}
    assert simplest.items() <= found.config.to_dict().items(), found
    assert 0 < found.clocks <= clocks, found
    assert (found.gap, found.sink, found.noisy) == (1, "always", False)
