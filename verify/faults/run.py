"""Run all fault injection trials, and compare the outcomes with the documented limits."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from eskin.base.files import Pieces, origin, pieces_of, write_json
from eskin.base.workers.cluster import Needs, version
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import TilesConfig
from eskin.verify.faults import classifier, host, merge, plan
from eskin.verify.faults import frame_readout as frames
from eskin.verify.faults.cases import cases
from eskin.verify.faults.outcomes import CLASSES, NEVER, WRITTEN, Upset, upsets
from eskin.verify.faults.plan import Trial, most_changed, most_off, most_ticks

CODE = Needs(packages=("base", "model", "rtl", "verify.faults"))
"""Packages that determine the results."""


MOST = ("own_clocks", "other_clocks", "ticks", "lost", "added", "off")
"""Fields of a bit flip of which a result stores the largest value."""


@dataclass
class Done:
    """Results of a fault injection campaign."""

    blocks: list[dict[str, Any]]  # results of the bit flips of each block in each trial
    cases: list[dict[str, Any]]  # results of each test with hostile inputs
    problems: list[str]  # effects that exceed the documented limits


def problems_of(trial: Trial, upset: Upset) -> str:
    """Return how an outcome exceeds the documented limits; empty if it does not."""
    if upset.outcome == NEVER:
        return "never recovers"
    if upset.outcome == WRITTEN and not upset.may_stay:
        return "stays until the host writes anew, which only a setting may"
    if isinstance(trial.config, ReadoutConfig) and upset.off > (off := most_off(trial.config, upset.block)):
        return f"signals of others are {upset.off} steps off for good, {off} stated"
    if not trial.calm:
        return ""
    most = most_changed(trial.config, upset.block)
    if max(upset.lost, upset.added) > most:
        return f"{upset.lost} events of others lost and {upset.added} added, {most} stated"
    longest = most_ticks(upset.block)
    if longest is not None and upset.ticks > longest:
        return f"others answer {upset.ticks} ticks later by other events, {longest} stated"
    return ""


def run(trial: Trial) -> tuple[list[dict[str, Any]], list[str]]:
    """Run a trial; return one result per block, and a sentence for each bit flip whose effect exceeds the limits."""
    of_block: dict[str, list[Upset]] = {}
    if getattr(trial.config, "fields", "own") != "own":
        of_block["fields"] = []  # a line in the report even without a flop
    problems: list[str] = []
    for upset in upsets_of(trial):
        of_block.setdefault(upset.block, []).append(upset)
        if wrong := problems_of(trial, upset):
            problems.append(f"{trial.name}: {upset.flop} turned at clock {upset.clock}: {wrong}")
    return [_line(trial, block, found) for block, found in sorted(of_block.items())], problems


def upsets_of(trial: Trial, flops: str = "") -> Iterator[Upset]:
    """Flip the flops of a trial whose names match a pattern, one per run; yield the outcomes."""
    config, stride = trial.config, trial.stride
    if isinstance(config, FrameConfig):
        return frames.upsets(config, stride, flops)
    if isinstance(config, ClassifierConfig):
        return classifier.upsets(config, stride, flops)
    if isinstance(config, TilesConfig):
        return merge.upsets(config, stride, flops)
    if config.registers != "none":
        return host.upsets(config, trial.mode, stride, flops or host.HOST)
    return upsets(config, trial.calm, trial.slow, stride, flops)


def _line(trial: Trial, block: str, found: list[Upset]) -> dict[str, Any]:
    """Return the result of a block in a trial as a dictionary."""
    outcomes = Counter(upset.outcome for upset in found)
    numbers = {"flops": len({upset.flop for upset in found}), "upsets": len(found)}
    most = {name.replace("_", " "): max((getattr(upset, name) for upset in found), default=0) for name in MOST}
    return {"block": block, "trial": trial.name, **numbers, **{name: outcomes[name] for name in CLASSES}, **most}


def campaign(small: bool, out: Path | None, tell: Callable[[str], None]) -> Done:
    """Run all fault injection trials and all tests with hostile inputs.

    Each piece is kept beside ``out`` as it comes, until ``write``: a campaign that was stopped goes on behind them,
    unless the code has changed. ``tell`` takes a line for each piece.
    """
    pieces = Pieces(out, version(CODE))
    done = Done([], [], [])
    jobs = [(str(trial), partial(_tried, trial)) for trial in plan.trials(small)]
    for name, job in jobs + [(str(config), partial(_met, config)) for config in plan.surroundings(small)]:
        piece = pieces.of(name, job)
        done.blocks += piece["blocks"]
        done.cases += piece["cases"]
        done.problems += piece["problems"]
        for line in piece["said"]:
            tell(line)
    return done


def _tried(trial: Trial) -> dict[str, Any]:
    lines, wrong = run(trial)
    said = f"{trial.name:<70}{sum(line['upsets'] for line in lines):>8} upsets{len(wrong):>4} problems"
    return {"blocks": lines, "cases": [], "problems": wrong, "said": [said]}


def _met(config: ReadoutConfig) -> dict[str, Any]:
    """Run all tests with hostile inputs on a readout."""
    met, told = [], []
    readout = f"{config.rows} x {config.columns}, {config.encoding}, {config.link}, {config.frontend}"
    for case in cases(config):
        good, runs = case.holds(config)
        met.append({"case": case.name, "stated": case.stated, "readout": readout, "runs": runs, "as stated": good})
        told.append(f"{readout:<36}{case.name:<42}{good:>4} of {runs} as stated")
    return {"blocks": [], "cases": met, "problems": [], "said": told}


def closing_line(done: Done) -> str:
    """Return the final message of ``make faults``."""
    total, never = (sum(line[name] for line in done.blocks) for name in ("upsets", NEVER))
    runs, good = (sum(line[name] for line in done.cases) for name in ("runs", "as stated"))
    wrong = len(done.problems) + runs - good
    return f"faults: {total} upsets, {never} of them for good, {runs} hostile runs, {wrong} beyond what is stated"


def write(path: Path, command: str, done: Done) -> None:
    """Write all results as JSON, and delete the partial results."""
    write_json(path, {**origin(command), "result": closing_line(done), **vars(done)})
    pieces_of(path).unlink(missing_ok=True)
