"""Compare the predictions of two sweep points or networks image by image."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.snn.experiments.intervals import bootstrap
from eskin.snn.experiments.points import READINGS, Point, load_sweep

ONE_SEED = ("accuracy_first", "accuracy_second", "only_first", "only_second", "p")
"""Fields of Pair with a value for every seed."""


@dataclass(frozen=True)
class Pair:
    """Predictions of two sweep points for the same images."""

    accuracy_first: list[float]
    accuracy_second: list[float]
    """Accuracy of every seed that both points have."""
    only_first: list[int]
    only_second: list[int]
    """Number of images of each seed that only one point classifies correctly."""
    p: list[float]
    """For every seed: McNemar's exact test, two-sided (Q. McNemar, Psychometrika 12, 1947). It is the probability of
    numbers at least as unequal, if each image that only one point classifies correctly belongs to either point with
    probability 1/2."""
    difference: float
    """Second minus first, mean over images and seeds."""
    interval: tuple[float, float]
    """Its 95 % bootstrap interval over images and seeds, which are drawn in pairs."""
    images: int


def find_point(text: str, kept: Path) -> Point:
    """Return the sweep point for a text ``SWEEP:POINT``, with SWEEP a file, a folder or a name in ``kept``.

    Raise InputError if the sweep or point does not exist or has no predictions.
    """
    name, colon, wanted = text.rpartition(":")
    if not colon:
        raise InputError(f"a point must be SWEEP:POINT, such as rates-cnn:lcs-4, not {text!r}")
    own = kept / f"{name}.json"
    sweep = load_sweep(own if own.is_file() else Path(name))
    points = {point["name"]: point for point in sweep.points}
    if wanted not in points:
        raise InputError(f"sweep {name} has no point {wanted!r}; it has {', '.join(points)}")
    point = points[wanted]
    words = [(point[reading] or {}).get("predictions") for reading in READINGS]
    if not point.get("labels") or not all(of_reading and all(of_reading) for of_reading in words):
        raise InputError(f"{text} has no predictions for images; run its sweep again")
    return point


def pair(first: Point, second: Point, reading: str) -> Pair:
    """Return the comparison of two sweep points over their common seeds.

    Raise InputError if the two points have different test images.
    """
    if any(first[name] != second[name] for name in ("labels", "class_names")):
        raise InputError(
            f"{first['name']} and {second['name']} have different images or classes and cannot be compared"
        )
    return compare(first["labels"], *(point[reading]["predictions"] for point in (first, second)))


def compare(labels: str, first: Sequence[str], second: Sequence[str]) -> Pair:
    """Return the comparison of two lists of predictions, with one text per seed."""
    from scipy.stats import binomtest

    seeds = min(len(first), len(second))
    of_first, of_second = right_of(labels, first[:seeds]), right_of(labels, second[:seeds])
    only_first = (of_first & ~of_second).sum(1).tolist()
    only_second = (of_second & ~of_first).sum(1).tolist()
    gains = of_second.astype(float) - of_first
    return Pair(
        accuracy_first=of_first.mean(1).tolist(),
        accuracy_second=of_second.mean(1).tolist(),
        only_first=only_first,
        only_second=only_second,
        p=[float(binomtest(a, a + b).pvalue) if a + b else 1.0 for a, b in zip(only_first, only_second, strict=True)],
        difference=float(gains.mean()),
        interval=bootstrap(gains.T),
        images=gains.shape[1],
    )


def right_of(labels: str, words: Sequence[str]) -> NDArray[np.bool_]:
    """Return whether each prediction is correct, shape (seeds, images)."""
    return np.array([[a == b for a, b in zip(word, labels, strict=True)] for word in words], bool)


def paired(points: Sequence[dict[str, Any]], first: str, second: str, of: Sequence[str]) -> list[dict[str, Any]]:
    """Return McNemar's tests of two networks on common images.

    Each test compares two points with equal values of the fields ``of``. A point is a result with the fields
    ``network`` and ``answers``: labels and predictions by fold and seed.
    """
    found = []
    for point in points:
        same = [p for p in points if p["network"] == second and all(p[name] == point[name] for name in of)]
        if point["network"] != first or not same:
            continue
        answers = [{(one["fold"], one["seed"]): one for one in p["answers"]} for p in (point, same[0])]
        cells = sorted(answers[0].keys() & answers[1].keys())
        if not cells:
            continue
        labels = "".join(answers[0][cell]["labels"] for cell in cells)
        result = compare(labels, *(["".join(own[cell]["predicted"] for cell in cells)] for own in answers))
        of_seed = {name: getattr(result, name)[0] for name in ONE_SEED}
        about = {"first": first, "second": second} | {name: point[name] for name in of}
        found.append(about | {"images": result.images} | of_seed)
    return found
