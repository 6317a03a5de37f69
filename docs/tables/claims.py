"""Comparisons of accuracies: McNemar's test with Holm's correction, computed from stored predictions.

Pages state that something is more or less accurate only from ``compared``; a test looks for other such statements.
"""

import statistics
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, TypeVar

from eskin.snn.experiments.pairs import Answers, mcnemar, right_of

LEVEL = 0.05
"""A comparison is significant if its corrected p value is lower."""

K = TypeVar("K")


class Claim(NamedTuple):
    """Result of a comparison."""

    difference: float
    """Accuracy of the second minus that of the first, mean over images and common seeds."""
    p: float
    """McNemar's p value, the median over the seeds, after Holm's correction for all comparisons of the list."""

    @property
    def verdict(self) -> str:
        """Whether the second is ``more`` or ``less`` accurate than the first; empty if it is not significant."""
        return "" if self.p >= LEVEL else "more" if self.difference > 0 else "less"


def compared(answers: Mapping[K, Answers]) -> dict[K, Claim]:
    """Return the result of every comparison in a list, by the same key."""
    found = {}
    for key, (labels, *words) in answers.items():
        seeds = min(map(len, words))
        first, second = (right_of(labels, own[:seeds]) for own in words)
        found[key] = float(second.mean() - first.mean()), statistics.median(mcnemar(first, second))
    corrected = holm([p for _, p in found.values()])
    return {key: Claim(gain, p) for (key, (gain, _)), p in zip(found.items(), corrected, strict=True)}


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p values after Holm's correction for several tests (S. Holm, Scand. J. Statist. 6(2):65, 1979)."""
    order = sorted(range(len(p_values)), key=p_values.__getitem__)
    found, least = [0.0] * len(order), 0.0
    for rank, number in enumerate(order):
        least = max(least, (len(order) - rank) * p_values[number])
        found[number] = min(1.0, least)
    return found


def counted(claims: Iterable[Claim]) -> dict[str, int]:
    """Return the number of comparisons ``of`` which the second is significantly ``more`` or ``less`` accurate."""
    verdicts = [claim.verdict for claim in claims]
    return {"of": len(verdicts), "more": verdicts.count("more"), "less": verdicts.count("less")}
