"""Measure the answers of a network during a touch, and the time until its evidence suffices."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.snn.data.scans import ScanData

PARTS = 20
"""Number of answers during a scan, evenly spread; the last answer uses the whole scan."""

WANTED = 0.97
"""Accuracy that early answers must reach in inner validation."""


def course_of(network: Any, data: ScanData, images: NDArray[np.int64], device: str) -> dict[str, Any]:
    """Return the answers of a network at ``PARTS`` times of the first scan of images.

    Returns
    -------
    dict
        ``times_s``: seconds from the first step, shape (PARTS,). ``answers``: classes, shape (PARTS, images).
        ``margin``: largest logit minus the next one, same shape, rounded to two digits.
    """
    from eskin.snn.train import logits_of

    scans = data.first_scans(images)
    steps = [max(1, round(data.steps * part / PARTS)) for part in range(1, PARTS + 1)]
    begun = (dataclasses.replace(data, values=data.values[:, :count], lengths=None) for count in steps)
    return course(np.array(steps) * data.step_s, np.stack([logits_of(network, one, scans, device) for one in begun]))


def course(times_s: NDArray[np.float64], logits: NDArray[np.floating[Any]]) -> dict[str, Any]:
    """Return times, answers and their margins for logits of shape (PARTS, images, classes)."""
    two = np.sort(logits, 2)[:, :, -2:]
    margin = (two[:, :, 1] - two[:, :, 0]).round(2)
    return {"times_s": times_s.tolist(), "answers": logits.argmax(2).tolist(), "margin": margin.tolist()}


def latency_of(cells: Sequence[dict[str, Any]], inner: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the accuracy of a point over time, and its early answers.

    The network answers as soon as the margin of its answer reaches a threshold, at the latest at the end of the scan.
    The threshold is the one with the earliest answers in inner validation whose accuracy there is at least ``WANTED``.

    Parameters
    ----------
    cells, inner
        Trainings with test images, and with inner validation images alone; all with the fields of ``course``.

    Returns
    -------
    dict
        ``times_s``, ``accuracy``: shape (PARTS,). ``early``: threshold, mean time and accuracy of the early answers,
        or None if no threshold reaches ``WANTED`` in inner validation.
    """
    times_s = np.array(cells[0]["times_s"])
    right, margin = _judged(cells)
    fitting = [
        (float(times_s[first].mean()), threshold)
        for threshold, first, accuracy in _thresholds(*_judged(inner))
        if accuracy >= WANTED
    ]
    early = None
    if fitting:
        threshold = min(fitting)[1]
        first = _first(margin, threshold)
        accuracy = float(np.take_along_axis(right, first[None], 0).mean())
        early = {"threshold": threshold, "mean_s": float(times_s[first].mean()), "accuracy": accuracy}
    return {"times_s": times_s.tolist(), "accuracy": right.mean(1).tolist(), "early": early}


def _judged(cells: Sequence[dict[str, Any]]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Return whether each answer is right, and its margin, shape (PARTS, images of all cells)."""
    right = np.concatenate([np.equal(cell["answers"], cell["labels"]) for cell in cells], 1)
    return right, np.concatenate([np.array(cell["margin"]) for cell in cells], 1)


def _first(margin: NDArray[np.float64], threshold: float) -> NDArray[np.intp]:
    """Return the index of the first answer whose margin suffices, or of the last answer, for each image."""
    enough = margin >= threshold
    enough[-1] = True
    return enough.argmax(0)


def _thresholds(right: NDArray[np.bool_], margin: NDArray[np.float64]) -> list[tuple[float, NDArray[np.intp], float]]:
    """Return each threshold with the index of the answer of every image, and the accuracy."""
    found = []
    for threshold in [*np.unique(margin).tolist(), float(margin.max()) + 1]:
        first = _first(margin, threshold)
        found.append((threshold, first, float(np.take_along_axis(right, first[None], 0).mean())))
    return found
