"""Compare networks on the same test images, image by image."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.snn.experiments.pairs import mcnemar

Points = Sequence[dict[str, Any]]
"""Results with the fields ``network`` and ``answers``, and fields that describe the case."""


def right_of(answers: Points) -> NDArray[np.float64]:
    """Return whether each prediction is correct, in the order of folds and seeds."""
    parts = sorted(answers, key=_cell)
    return np.concatenate(
        [[float(a == b) for a, b in zip(one["labels"], one["predicted"], strict=True)] for one in parts]
    )


def paired(points: Points, first: str, second: str, of: Sequence[str]) -> list[dict[str, Any]]:
    """Return McNemar's tests of two networks on common images.

    Each test compares two points with equal values of the fields ``of``.
    """
    found = []
    for point in points:
        same = [p for p in points if p["network"] == second and all(p[name] == point[name] for name in of)]
        if point["network"] != first or not same:
            continue
        cells = {_cell(a) for a in point["answers"]} & {_cell(a) for a in same[0]["answers"]}
        if not cells:
            continue
        a, b = (right_of([x for x in p["answers"] if _cell(x) in cells]).astype(bool) for p in (point, same[0]))
        only = int((a & ~b).sum()), int((b & ~a).sum())
        about = {"first": first, "second": second} | {name: point[name] for name in of}
        accuracies = {"accuracy_first": float(a.mean()), "accuracy_second": float(b.mean())}
        tested = {"only_first": only[0], "only_second": only[1], "p": mcnemar(*only)}
        found.append(about | {"images": len(a)} | accuracies | tested)
    return found


def _cell(answer: dict[str, Any]) -> tuple[int, int]:
    return answer["fold"], answer["seed"]
