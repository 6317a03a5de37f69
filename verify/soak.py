"""Random runs for hours: RTL compared with the model, and a difference reduced to the smallest run."""

from __future__ import annotations

import contextlib
import random
import shlex
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.base.files import origin, write_json
from eskin.base.shapes import read_shaped
from eskin.cocotb_tests.bench.random_run import RandomRun, runs
from eskin.cocotb_tests.runner.build_cache import BUILD, SOURCES, scratch_folder
from eskin.cocotb_tests.runner.cocotb_runners import Simulator
from eskin.cocotb_tests.runner.process import MismatchFound, ReadoutRun, Tally, play_runs
from eskin.cocotb_tests.runner.simulator import build
from eskin.model.cases import count, values_of

if TYPE_CHECKING:  # for tests only, so imported by the function that needs it
    from hypothesis import strategies as st

BATCH = 100
"""Runs that are drawn from one seed."""

SMALL_CLOCKS = 20_000
"""Largest number of clocks of a run that is reduced with Icarus, because its programs build fast."""

SUMMED = ("runs", "clocks", "events")
TOTALS = {
    "sources": str,
    "next seed": int,
    "seconds": float,
    "by": {name: dict.fromkeys(values, int) for name, values in count([]).items()},
    **dict.fromkeys(SUMMED, int),
}
"""Fields of the file of totals that a later soak adds to."""


@dataclass(frozen=True)
class Plan:
    """Parameters of a soak."""

    seconds: float  # time after which no further run begins
    seed: int  # of the first runs
    clocks: int  # most clocks of a run
    simulator: Simulator
    out: Path | None = None  # file of the totals


RESULT = "soak: {clocks:,} clocks, {events:,} events, {runs} configurations, 0 mismatches"


class SoakFailed(Exception):  # the expected outcome for a faulty RTL, not a defect of this program
    """Raised if RTL and model differ, with the smallest run and the command that repeats it."""


def play(runs: Sequence[RandomRun], simulator: Simulator) -> Tally:
    """Simulate random runs of one configuration, and return the comparison totals."""
    commands = [f"eskin dev soak --sim {simulator} --only {shlex.quote(run.to_json())}" for run in runs]
    compared = (
        ReadoutRun(run.config, f"seed {run.seed}", run.stimulus, again)
        for run, again in zip(runs, commands, strict=True)
    )
    with scratch_folder(BUILD / "run", "soak") as folder:
        return play_runs(build(runs[0].config, simulator), compared, folder)


def search(
    drawn: st.SearchStrategy[RandomRun], differs: Callable[[RandomRun], bool], examples: int, seed: int
) -> RandomRun | None:
    """Draw a number of runs, and return the smallest run in which RTL and model differ, or None."""
    from hypothesis import HealthCheck, Phase, find, settings
    from hypothesis.errors import NoSuchExample

    rules = settings(
        max_examples=examples,
        database=None,
        deadline=None,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )
    with contextlib.suppress(NoSuchExample):
        return find(drawn, differs, settings=rules, random=random.Random(seed))
    return None


def soak(plan: Plan, on_run: Callable[[RandomRun, Tally], object]) -> dict[str, Any]:
    """Play random runs until the time is over, and return the totals, which are also in the file of the plan."""
    totals, end = _kept(plan), time.monotonic() + plan.seconds
    difference = ""

    def differs(run: RandomRun) -> bool:
        nonlocal difference
        if not difference and time.monotonic() >= end:
            return False
        began = time.monotonic()
        try:
            tally = play([run], "icarus" if difference and run.clocks <= SMALL_CLOCKS else plan.simulator)
        except MismatchFound as found:
            difference = str(found)
            return True
        if not difference:
            _add(totals, run, tally, round(time.monotonic() - began, 1))
            if plan.out:
                write_json(plan.out, origin(f"make soak HOURS={totals['seconds'] / 3600:.2f}") | totals)
            on_run(run, tally)
        return False

    while time.monotonic() < end:
        totals["next seed"] += 1
        if search(runs(plan.clocks), differs, BATCH, totals["next seed"] - 1) is not None:
            raise SoakFailed(difference)
    return totals


def _add(totals: dict[str, Any], run: RandomRun, tally: Tally, seconds: float) -> None:
    """Add a run to the totals."""
    totals |= {name: totals[name] + getattr(tally, name) for name in SUMMED}
    for name, value in values_of(run.config).items():
        totals["by"][name][value] = totals["by"][name].get(value, 0) + 1
    totals["seconds"] += seconds
    totals["result"] = RESULT.format_map(totals)


def _kept(plan: Plan) -> dict[str, Any]:
    """Return the totals in the file of a soak of the same sources, or empty totals."""
    if plan.out and plan.out.exists() and read_shaped(plan.out, "the soak", {"sources": str})["sources"] == SOURCES:
        return dict(read_shaped(plan.out, "the soak", TOTALS))
    totals = {
        "sources": SOURCES,
        "simulator": plan.simulator,
        "next seed": plan.seed,
        "seconds": 0.0,
        "by": count([]),
        **dict.fromkeys(SUMMED, 0),
    }
    return totals | {"result": RESULT.format_map(totals)}
