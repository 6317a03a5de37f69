"""Run a fault injection trial, and compare the outcomes with the documented limits."""

from collections import Counter
from collections.abc import Iterator
from typing import Any

from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import TilesConfig
from eskin.verify.faults import classifier, host, merge
from eskin.verify.faults import frame_readout as frames
from eskin.verify.faults.outcomes import CLASSES, NEVER, WRITTEN, Upset, upsets
from eskin.verify.faults.plan import Trial, most_changed, most_off, most_ticks

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
