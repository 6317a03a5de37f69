"""Pairs: every two points of a sweep, compared image by image with McNemar's exact test.

The sweeps are those of the project and ``out/sweep/sweep.json``, which ``eskin sweep`` writes. The comparison needs no
training: the sweeps contain the predictions.
"""

import dataclasses
import itertools
from collections.abc import Iterator
from typing import Any

from eskin.snn.experiments.pairs import pair
from eskin.snn.experiments.points import READINGS, Point, load_sweep
from studies.fig9 import KEPT, LATEST, READING
from studies.study import Data, Result, run


def compute() -> Data:
    """Return the comparisons of all sweeps, by the name of the sweep."""
    sweeps = [load_sweep(path) for path in [*sorted(KEPT.glob("*.json")), *[LATEST] * LATEST.is_file()]]
    return {"reading": READING, "sweeps": {sweep.name: list(pairs_of(sweep.points)) for sweep in sweeps}}


def pairs_of(points: list[Point]) -> Iterator[dict[str, Any]]:
    """Yield the comparisons of every two points that have predictions for the same images."""
    told = [point for point in points if point.get("labels") and all(_predicted(point, name) for name in READINGS)]
    for first, second in itertools.combinations(told, 2):
        if all(first[name] == second[name] for name in ("labels", "class_names")):
            names = {"first": first["name"], "second": second["name"]}
            yield names | dataclasses.asdict(pair(first, second, READING))


def _predicted(point: Point, reading: str) -> bool:
    words = (point[reading] or {}).get("predictions") or [""]
    return all(words)


RESULT = Result("pairs", compute)

if __name__ == "__main__":
    run("pair", RESULT)
