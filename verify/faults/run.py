"""Run a fault injection trial, and compare the outcomes with the documented limits."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from eskin.base.workers.engine import Needs, Pool, each
from eskin.base.workers.store import Store
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import TilesConfig
from eskin.verify.faults import classifier, host, merge
from eskin.verify.faults import frame_readout as frames
from eskin.verify.faults.cases import cases
from eskin.verify.faults.outcomes import CLASSES, NEVER, WRITTEN, Upset, upsets
from eskin.verify.faults.plan import Trial, most_changed, most_off, most_ticks

NEEDS = Needs(packages=("base", "model", "rtl", "verify.faults"))
"""Packages and libraries that determine the results."""

MOST = ("own_clocks", "other_clocks", "ticks", "lost", "added", "off")
"""Fields of a bit flip of which a result stores the largest value."""


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
    if getattr(trial.config, "receptive_fields", "own") != "own":
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


Part = Trial | ReadoutConfig
"""A trial of bit flips, or a readout with hostile inputs."""


def outcomes_of(part: Part) -> dict[str, Any]:
    """Return outcomes of a trial by block with effects beyond the stated limits, or results of hostile inputs."""
    if isinstance(part, Trial):
        blocks, problems = run(part)
        return {"blocks": blocks, "cases": [], "problems": problems}
    readout, met = f"{part.rows} x {part.columns}, {part.encoding}, {part.link}, {part.frontend}", []
    for case in cases(part):
        good, runs = case.holds(part)
        met.append({"case": case.name, "stated": case.stated, "readout": readout, "runs": runs, "as stated": good})
    return {"blocks": [], "cases": met, "problems": []}


def campaign(parts: Iterable[Part], pool: Pool, store: Store, say: Callable[[str], object]) -> dict[str, Any]:
    """Return the outcomes of trials and hostile inputs with a line on all; ``say`` is called with a line on each."""
    found: dict[str, list[Any]] = {"blocks": [], "cases": [], "problems": []}
    for piece in each(pool, outcomes_of, ((part,) for part in parts), store=store, name=str):
        for kind, lines in found.items():
            lines += piece[kind]
        if piece["blocks"]:
            trial, flips = piece["blocks"][0]["trial"], sum(line["upsets"] for line in piece["blocks"])
            say(f"{trial:<70}{flips:>8} upsets{len(piece['problems']):>4} problems")
        for case in piece["cases"]:
            say(f"{case['readout']:<36}{case['case']:<42}{case['as stated']:>4} of {case['runs']} as stated")
    flips, never = (sum(line[name] for line in found["blocks"]) for name in ("upsets", NEVER))
    runs, good = (sum(line[name] for line in found["cases"]) for name in ("runs", "as stated"))
    result = f"faults: {flips} upsets, {never} of them for good, {runs} hostile runs, "
    result += f"{len(found['problems']) + runs - good} beyond what is stated"
    say(result)
    return {"result": result, **found}
