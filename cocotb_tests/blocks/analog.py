"""Compare RTL and model for comparators with offset, noise, hysteresis and overdrive."""

import dataclasses
import random
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eskin.cocotb_tests.bench.analog import FRACTION_BITS, Comparators, read_decisions
from eskin.cocotb_tests.bench.block import Simulator
from eskin.cocotb_tests.bench.readout import Mismatch, Outcome, compare, write_stimulus
from eskin.cocotb_tests.bench.stimuli import READY, ack_delays
from eskin.cocotb_tests.runner.process import ReadoutRun, play_runs
from eskin.cocotb_tests.runner.simulator import build
from eskin.model.address_events import Events
from eskin.model.config import ReadoutConfig
from eskin.model.readout import Stimulus

CLOCKS = 4000


def drive(config: ReadoutConfig, samples: np.ndarray, seed: int) -> Stimulus:
    """Return a stimulus with a sample tick every eight clocks, and a sink with random stalls."""
    rng = np.random.default_rng(seed)
    ticks = np.resize(samples, (CLOCKS // 8, config.taxels))
    return Stimulus.from_samples(
        config, ticks, clocks_per_sample=8, ready=READY["random"](rng), ack_delay=ack_delays("always", rng)
    )


def never_off_the_scale(config: ReadoutConfig, events: Events, counts: Counter[str]) -> None:
    """Check from the events that the references of LCS stay within full scale."""
    for y, x in np.ndindex(config.rows, config.columns):
        own = events["p"][(events["y"] == y) & (events["x"] == x)]
        levels = config.reference_reset + config.step * np.cumsum(np.where(own, 1, -1))
        if not ((levels >= -config.full_scale) & (levels < config.full_scale)).all():
            raise Mismatch(f"the reference of taxel ({y}, {x}) leaves the scale: {levels.tolist()}")
        counts["ends"] += int(np.isin(levels, (-config.full_scale, config.full_scale - config.step)).sum())


@dataclass(frozen=True)
class FaultyRun:
    """A run whose model is given the recorded decisions of the comparators."""

    config: ReadoutConfig
    name: str
    stimulus: Stimulus
    comparators: Comparators
    counts: Counter[str]
    skip: bool = False

    def write(self, folder: Path) -> None:
        write_stimulus(self.config, folder, self.stimulus, self.comparators, record=True)

    def report(self, folder: Path, outcome: Outcome) -> dict[str, Any]:
        decisions = read_decisions(self.config, folder)
        given = dataclasses.replace(self.stimulus, decisions=decisions)
        events = compare(self.config, self.name, given, folder, outcome, "")
        self.counts["random"] += int((np.diff(decisions.astype(int), axis=0) != 0).sum())
        self.counts["both"] += int((decisions == 3).sum())
        if not self.config.encoder.late:
            never_off_the_scale(self.config, events, self.counts)
        return {"name": self.name, "clocks": given.clocks, "events": len(events)}


def runs_with_faults(config: ReadoutConfig, rng: random.Random, counts: Counter[str]) -> Iterator[FaultyRun]:
    """Yield signals beyond full scale, slow signals with noise and offset, and pure noise."""
    code, high = 1 << FRACTION_BITS, config.full_scale
    offset = np.array([[rng.randint(-3 * code, 3 * code) for _ in range(config.taxels)] for _ in range(2)])
    angle = np.linspace(0, 6, CLOCKS // 8)[:, None] + np.arange(config.taxels)
    square = np.where(np.sin(angle) > 0, 2 * high, -2 * high - 1)
    slow = Comparators(offset, noise=config.step * code, hysteresis=2 * code, seed=7)
    noise = Comparators(noise=4 * high * code, seed=rng.randint(1, 1 << 30))
    for name, signal, comparators in (
        ("slow", 1.1 * high * np.sin(angle), slow),
        ("over", square, Comparators(offset, noise=code, seed=3)),
        ("nothing but noise", 0 * angle, noise),
    ):
        stimulus = drive(config, np.rint(signal).astype(np.int64), seed=len(name))
        yield FaultyRun(config, name, stimulus, comparators, counts)


def play_faults(config: ReadoutConfig, simulator: Simulator, folder: Path) -> Counter[str]:
    """Play comparators with faults, and return the counts of what happened."""
    counts: Counter[str] = Counter()
    rng = random.Random(random.Random(config.to_json()).randrange(1000))
    tally = play_runs(build(config, simulator), runs_with_faults(config, rng, counts), folder)
    counts["events"] = tally.events
    return counts


def events_at(config: ReadoutConfig, level: int, simulator: Simulator, folder: Path) -> int:
    """Return the number of events of a signal that stays at a level."""
    stimulus = drive(config, np.full((1, config.taxels), level), seed=1)
    run = ReadoutRun(config, f"{level} codes for ever", stimulus, "")
    return play_runs(build(config, simulator), [run], folder).events
