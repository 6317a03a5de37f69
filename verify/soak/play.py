"""Simulate random runs, and compare the RTL with the model."""

import dataclasses
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from eskin.base.errors import InputError
from eskin.cocotb_tests.bench.draw import MOST_TAXELS, Draw
from eskin.cocotb_tests.runner.build_cache import BUILD, scratch_folder
from eskin.cocotb_tests.runner.cocotb_runners import Simulator
from eskin.cocotb_tests.runner.process import MismatchFound, ReadoutRun, Tally, play_runs
from eskin.cocotb_tests.runner.simulator import build


def command(draw: Draw, simulator: Simulator) -> str:
    """Return the make command that repeats a single run."""
    words = ["make soak", f"ONLY={draw.seed}", f"RUN={draw.run}", f"CLOCKS={draw.clocks}", f"SIM={simulator}"]
    parts = dict(draw.set)
    if draw.most_taxels != MOST_TAXELS:
        parts |= {"rows": draw.config.rows, "columns": draw.config.columns}
    if parts:
        words.append(f'SET="{" ".join(f"{name}={value}" for name, value in parts.items())}"')
    return " ".join(words)


def play(draws: Sequence[Draw], simulator: Simulator) -> Tally:
    """Simulate random runs of one configuration, and return the comparison totals."""
    runs = (
        ReadoutRun(draw.config, f"seed {draw.seed}, run {draw.run}", draw.stimulus, command(draw, simulator))
        for draw in draws
    )
    with scratch_folder(BUILD / "run", "soak") as folder:
        return play_runs(build(draws[0].config, simulator), runs, folder)


@dataclass(frozen=True)
class Failure:
    """A run in which RTL and model differ."""

    draw: Draw
    clock: int  # of the first difference; the last clock where the text names none
    text: str


def failure(draw: Draw, simulator: Simulator) -> Failure | None:
    """Return the first difference between RTL and model in a run, or None."""
    try:
        play([draw], simulator)
    except MismatchFound as found:
        return failure_of(draw, str(found))
    return None


def failure_of(draw: Draw, text: str) -> Failure:
    """Return the failure described by a mismatch message."""
    said = re.search(r"before clocks \d+ to (\d+)", text)
    return Failure(draw, int(said[1]) if said else draw.clocks - 1, text)


SIMPLER: dict[str, tuple[Any, ...]] = {
    "masks": (0,),
    "sink": ("always",),
    "link": ("stream",),
    "frontend": ("digital",),
    "reset": ("sync",),
    "registers": ("none",),
    "decide_every": ("clock",),
    "encoding": ("lcs",),
    "rows": (1, 2, 3),
    "columns": (1, 2, 3),
    "gap": (1, 3),
    "signal": ("hold",),
    "reference_reset": (0,),
}
"""Simpler values for the parts of a draw, the simplest first."""


def shrink(found: Failure, fails: Callable[[Draw], Failure | None], tries: int = 60) -> Failure:
    """Return a smaller run that still fails, with every parameter simplified."""
    room, best = max(found.clock + 2, 200), _cut(found, fails)
    for name, values in SIMPLER.items():
        for value in values:
            now = best.draw.set.get(name, getattr(best.draw.config, name, None))
            if tries == 0 or now == value:
                break
            tries -= 1
            smaller = dataclasses.replace(best.draw, set={**best.draw.set, name: value}, clocks=room)
            if (again := _tried(smaller, fails)) is not None:
                best = _cut(again, fails)
                break
    return best


def _tried(draw: Draw, fails: Callable[[Draw], Failure | None]) -> Failure | None:
    """Return the failure of a run, or None; a run with incompatible parameters does not fail."""
    try:
        return fails(draw)
    except InputError:
        return None


def _cut(found: Failure, fails: Callable[[Draw], Failure | None]) -> Failure:
    """Return the failing run stopped after its first difference, if it still fails."""
    shorter = dataclasses.replace(found.draw, clocks=min(found.clock + 2, found.draw.clocks))
    return _tried(shorter, fails) or found
