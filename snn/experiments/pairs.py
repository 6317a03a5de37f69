"""Compare the predictions of two sweep points or networks image by image."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eskin.snn.experiments.intervals import bootstrap


class Answers(NamedTuple):
    """Predictions of two points or networks for the same images, one text or list for each seed."""

    labels: Sequence[Any]
    first: Sequence[Sequence[Any]]
    second: Sequence[Sequence[Any]]


@dataclass(frozen=True)
class Pair:
    """Predictions of two points or networks for the same images."""

    accuracy_first: list[float]
    accuracy_second: list[float]
    """Accuracy of every seed that both points have."""
    only_first: list[int]
    only_second: list[int]
    """Number of images of each seed that only one point classifies correctly."""
    p: list[float]
    """For every seed: ``mcnemar``."""
    difference: float
    """Second minus first, mean over images and seeds."""
    interval: tuple[float, float]
    """Its 95 % bootstrap interval over images and seeds, which are drawn in pairs."""
    images: int


def compare(labels: Sequence[Any], first: Sequence[Sequence[Any]], second: Sequence[Sequence[Any]]) -> Pair:
    """Return the comparison of two lists of predictions, with one text or list per seed."""
    seeds = min(len(first), len(second))
    of_first, of_second = right_of(labels, first[:seeds]), right_of(labels, second[:seeds])
    gains = of_second.astype(float) - of_first
    return Pair(
        accuracy_first=of_first.mean(1).tolist(),
        accuracy_second=of_second.mean(1).tolist(),
        only_first=(of_first & ~of_second).sum(1).tolist(),
        only_second=(of_second & ~of_first).sum(1).tolist(),
        p=mcnemar(of_first, of_second),
        difference=float(gains.mean()),
        interval=bootstrap(gains.T),
        images=gains.shape[1],
    )


def common_answers(first: Mapping[str, Any], second: Mapping[str, Any]) -> Answers:
    """Return the predictions of two results of a study for the trainings that both have, as one seed.

    A result has ``answers``: labels and predictions by fold and seed.
    """
    own, other = ({(one["fold"], one["seed"]): one for one in result["answers"]} for result in (first, second))
    cells = sorted(own.keys() & other.keys())
    labels, *words = (
        [digit for cell in cells for digit in part[cell][name]]
        for part, name in ((own, "labels"), (own, "predicted"), (other, "predicted"))
    )
    return Answers(labels, words[:1], words[1:])


def mcnemar(first: NDArray[np.bool_], second: NDArray[np.bool_]) -> list[float]:
    """Return the p value of McNemar's exact test, two-sided, for every seed (Q. McNemar, Psychometrika 12, 1947).

    It is the probability of numbers at least as unequal, if each image that only one of two classifies correctly
    belongs to either with probability 1/2. ``first``, ``second``: correct predictions, shape (seeds, images).
    """
    counts = zip((first & ~second).sum(1).tolist(), (second & ~first).sum(1).tolist(), strict=True)
    return [min(1.0, 2 * sum(comb(a + b, k) for k in range(min(a, b) + 1)) / 2 ** (a + b)) for a, b in counts]


def right_of(labels: Sequence[Any], words: Sequence[Sequence[Any]]) -> NDArray[np.bool_]:
    """Return whether each prediction is correct, shape (seeds, images)."""
    return np.array([[a == b for a, b in zip(word, labels, strict=True)] for word in words], bool)
