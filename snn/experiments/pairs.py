"""Compare the predictions of two sweep points or networks image by image."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.snn.experiments.intervals import bootstrap
from eskin.snn.experiments.points import Point


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
