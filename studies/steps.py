"""Steps: LCS near 1,000 events/s with a step that is no power of two, or that grows with each event and shrinks again.

Only this model has these steps: no readout of the project has them.
"""

import dataclasses
import math
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from eskin.base.progress import bar
from eskin.skin.textures.dataset import open_dataset
from eskin.skin.textures.physical import PhysicalScan
from eskin.snn.data.scans import ScanData
from studies.frontier import FOLDS, INNER, Point, result_of, train_cells
from studies.study import Data, Result, run

LINES = "lcs:2/12x16:across:12"

WANTED_HZ = 1_000.0
"""Event rate to which the smallest step is fitted, on the first scan of each image."""

MOST = 4.0
"""Largest step, as a multiple of the smallest."""


class Rule(NamedTuple):
    """How the step of a taxel changes."""

    network: str
    growth: float = 1.0
    """Factor at each event."""
    shrinks_s: float = 0.0
    """Time constant with which it returns to the smallest step."""


RULES = (
    Rule("leaky-96"),
    Rule("leaky-96", 2.0, 0.002),
    Rule("leaky-96", 1.5, 0.005),
    Rule("leaky-96", 1.5, 0.02),
)


@numba.njit(cache=True)
def count(codes: Any, least: float, growth: float, stays: float, ticks: int, counts: Any) -> int:
    """Add the events of codes (ticks, taxels) to the counts (bins, 2 x taxels); return their number.

    ``least``: the smallest step in codes. ``stays``: the part of the growth that is left after a tick. ``ticks``: ticks
    of a bin.
    """
    events, taxels = 0, codes.shape[1]
    for taxel in range(taxels):
        reference, step = 0.0, least
        for tick in range(codes.shape[0]):
            while True:
                difference = codes[tick, taxel] - reference
                if difference >= step:
                    reference += step
                    channel = taxel
                elif difference < -step:
                    reference -= step
                    channel = taxels + taxel
                else:
                    break
                events += 1
                if tick // ticks < counts.shape[0]:
                    counts[tick // ticks, channel] += 1
                step = min(step * growth, least * MOST)
            step = least + (step - least) * stays
    return events


def fitted(rule: Rule, first: list[NDArray[Any]], sample_rate_hz: float) -> float:
    """Return the smallest step in codes with which scans have at most ``WANTED_HZ``."""
    seconds = sum(map(len, first)) / sample_rate_hz
    none, low, high = np.zeros((0, 1), np.int16), 1.0, 2048.0
    for _ in range(20):
        middle = math.sqrt(low * high)
        events = sum(count(codes, middle, rule.growth, stays_of(rule, sample_rate_hz), 1, none) for codes in first)
        low, high = (middle, high) if events > WANTED_HZ * seconds else (low, middle)
    return high


def stays_of(rule: Rule, sample_rate_hz: float) -> float:
    """Return the part of the growth that is left after a tick."""
    return math.exp(-1 / (rule.shrinks_s * sample_rate_hz)) if rule.shrinks_s else 0.0


def recorded(point: Point, rules: tuple[Rule, ...]) -> list[tuple[float, ScanData]]:
    """Return smallest step and scans of each rule; all get the same codes."""
    experiment = point.experiment()
    (scan, config), textures = experiment.scan_and_config(), open_dataset()
    assert isinstance(scan, PhysicalScan)
    like, images = experiment.data(), [texture.load() for texture in textures]
    rows = scan.start_rows(config, images[0].shape, experiment.start_rows)
    first = [scan.samples(config, image, rows[0])[0] for image in images]
    steps = [fitted(rule, first, config.sample_rate_hz) for rule in rules]
    values = [np.zeros_like(like.values) for _ in rules]
    ticks, number = round(like.step_s * config.sample_rate_hz), 0
    with bar("scans", len(like)) as tick:
        for image in images:
            for row in rows:
                codes = scan.samples(config, image, row)[0]
                for rule, step, own in zip(rules, steps, values, strict=True):
                    count(codes, step, rule.growth, stays_of(rule, config.sample_rate_hz), ticks, own[number])
                number += 1
                tick()
    seconds = len(like) * like.steps * like.step_s
    return [
        (step, dataclasses.replace(like, values=own, rate_hz=float(own.sum() / seconds)))
        for step, own in zip(steps, values, strict=True)
    ]


def compute() -> Data:
    """Return the inner validation of each rule, and the test of the best one over all folds."""
    tried: list[dict[str, Any]] = []
    points = [Point("physical", rule.network, *LINES.split("/")) for rule in RULES]
    scans = recorded(points[0], RULES)
    for rule, point, (step, data) in zip(RULES, points, scans, strict=True):
        experiment = point.experiment()
        inner = [train_cells(data, experiment, [(fold, 0)], True, "cpu")[0] for fold in range(INNER)]
        means = {name: float(np.mean([cell[name] for cell in inner])) for name in ("of_scans", "learned")}
        rates = {"rate_hz": data.rate_hz, "bits_per_s": data.rate_hz * experiment.bits_per_event}
        tried.append(rule._asdict() | {"step": step} | rates | means)
    best = max(range(len(tried)), key=lambda number: tried[number]["of_scans"])
    experiment, data = points[best].experiment(), scans[best][1]
    cells = [train_cells(data, experiment, [(fold, 0)], False, "cpu")[0] for fold in range(FOLDS)]
    return {"rules": tried, "chosen": best, "test": result_of(cells)}


RESULT = Result("steps", compute, long=True)

if __name__ == "__main__":
    run("steps", RESULT)
