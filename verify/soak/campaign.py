"""Run random configurations for hours, resumably, in several processes."""

import contextlib
import os
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eskin.base.files import atomic_write, make_folder, origin, write_json
from eskin.base.shapes import read_shaped
from eskin.cocotb_tests.bench.draw import Draw
from eskin.cocotb_tests.runner.build_cache import SOURCES, locked
from eskin.cocotb_tests.runner.cocotb_runners import Simulator
from eskin.cocotb_tests.runner.process import MismatchFound
from eskin.verify.soak.play import Failure, failure, failure_of, play, shrink

MOST_SAMPLES = 4_000_000
"""Largest number of samples of a run, over all taxels."""
RUN_CLOCKS = 2_000_000
SUMMED = ("runs", "clocks", "events")
SMALL_CLOCKS = 20_000
"""Largest number of clocks of a failure that is shrunk with Icarus, because its programs build fast."""


@dataclass(frozen=True)
class Plan:
    """Parameters of a soak test."""

    seconds: float  # time after which no further run begins
    seed: int  # first seed
    clocks: int  # of each configuration
    simulator: Simulator
    folder: Path  # holds a file for every configuration that is done, and one for each that failed


class SoakFailed(Exception):  # the expected outcome for a faulty RTL, not a defect of this program
    """Raised if RTL and model differ, with the smallest command that reproduces the difference."""


PIECE = {
    "configuration": {"rows": int, "columns": int},
    "seconds": float,
    **dict.fromkeys(("seed", *SUMMED), int),
    **dict.fromkeys(("sources", "simulator", "commit"), str),
}
"""Fields of the file of a configuration."""


def soak(plan: Plan, on_piece: Callable[[dict[str, Any]], None]) -> None:
    """Test random configurations until the time is over.

    A configuration that the end of the time has cut off keeps the runs that are done, and goes on there.
    """
    folder = make_folder(plan.folder, "pieces")
    _pieces(plan.folder)  # report a damaged file before the work
    end = time.monotonic() + plan.seconds
    seed = plan.seed
    more = plan.seconds > 0
    while more:
        with _claimed(folder / f"{seed}.json", plan) as mine:
            if mine:
                piece = _piece(plan, seed, _kept_piece(folder / f"{seed}.json"), end)
                write_json(folder / f"{seed}.json", piece)
                on_piece(piece)
                more = time.monotonic() < end
        seed += 1


def draws_of(plan: Plan, seed: int) -> list[Draw]:
    """Return the runs of a configuration, each so short that its samples fit into memory."""
    draws: list[Draw] = []
    left = plan.clocks
    while left > 0:
        draw = Draw(seed, 1, run=len(draws))
        samples = MOST_SAMPLES * draw.mean_gap / draw.config.taxels
        clocks = int(min(left, RUN_CLOCKS, max(samples, 1)))
        draws.append(Draw(seed, clocks, run=len(draws)))
        left -= clocks
    return draws


def _piece(plan: Plan, seed: int, before: dict[str, Any], end: float) -> dict[str, Any]:
    """Continue the runs of a configuration until the time is over, and return the totals."""
    draws = draws_of(plan, seed)
    total = Counter({name: before.get(name, 0) for name in SUMMED})
    began = time.monotonic()
    for draw in draws[total["runs"] :]:
        try:
            tally = play([draw], plan.simulator)
        except MismatchFound as found:
            raise SoakFailed(_kept(plan, failure_of(draw, str(found)))) from None
        total.update({name: getattr(tally, name) for name in SUMMED})
        if time.monotonic() >= end:
            break
    spent = round(before.get("seconds", 0) + time.monotonic() - began, 1)
    piece = {"seed": seed, "configuration": draws[0].config.to_dict(), "sources": SOURCES, "simulator": plan.simulator}
    return piece | dict(total) | {"seconds": spent} | origin(f"make soak ONLY={seed}")


def _kept(plan: Plan, found: Failure) -> str:
    """Shrink a failure, write its description to a file, and return it."""

    def fails(draw: Draw) -> Failure | None:
        return failure(draw, "icarus" if draw.clocks <= SMALL_CLOCKS else plan.simulator)

    text = shrink(found, fails).text
    with atomic_write(make_folder(plan.folder, "mismatches") / f"{found.draw.seed}.txt") as file:
        file.write(f"{text}\n\nat first: {found.text}\n".encode())
    return text


@contextlib.contextmanager
def _claimed(piece: Path, plan: Plan) -> Iterator[bool]:
    """Lock a configuration; yield True if it has runs left and no other process tests it."""
    try:
        with locked(piece.with_suffix(".lock"), os.O_RDWR | os.O_CREAT, wait=False):
            yield _kept_piece(piece).get("clocks", 0) < plan.clocks
    except BlockingIOError:
        yield False


def _kept_piece(piece: Path) -> dict[str, Any]:
    """Return the stored result of a configuration for the current sources, or an empty one."""
    kept = read_shaped(piece, "the soaked piece", PIECE) if piece.exists() else {}
    return dict(kept) if kept.get("sources") == SOURCES else {}


def _pieces(folder: Path) -> list[dict[str, Any]]:
    return [read_shaped(path, "the soaked piece", PIECE) for path in sorted((folder / "pieces").glob("*.json"))]


def summary(folder: Path) -> dict[str, Any]:
    """Return the totals of all results in a folder, for the current and for other sources."""
    pieces = _pieces(folder)
    mismatches = len(list((folder / "mismatches").glob("*.txt")))
    total = {name: sum(piece[name] for piece in pieces) for name in SUMMED}
    by: dict[str, Counter[str]] = {}
    for piece in pieces:
        for name in ("encoding", "link", "frontend", "decide_every", "reset", "registers"):
            by.setdefault(name, Counter())[str(piece["configuration"].get(name, "none"))] += 1
    seeds = sorted(piece["seed"] for piece in pieces)
    result = f"{total['clocks']:,} clocks, {total['events']:,} events, {len(pieces)} configurations, "
    return {
        "result": f"soak: {result}{mismatches} mismatches",
        "configurations": len(pieces),
        **total,
        "mismatches": mismatches,
        "seeds": [seeds[0], seeds[-1]] if seeds else [],
        "most_taxels": max((p["configuration"]["rows"] * p["configuration"]["columns"] for p in pieces), default=0),
        "by": {name: dict(sorted(counter.items())) for name, counter in by.items()},
        "simulators": dict(sorted(Counter(piece["simulator"] for piece in pieces).items())),
        "seconds": round(sum(piece["seconds"] for piece in pieces)),
        "commits": sorted({piece["commit"] for piece in pieces}),
    }
