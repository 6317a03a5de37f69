"""Measure the answers of networks during a touch, and the time until their evidence suffices.

The results are in docs/results/what_events_are_good_for.md and docs/results/frontier.md.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.snn.data.scans import ScanData
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.robustness import Cells, Subject, by_case, in_words, score_of

PARTS = 20
"""Number of answers during a scan, evenly spread; the last answer uses the whole scan."""

WANTED = 0.97
"""Accuracy that early answers must reach in inner validation."""


def course_of(network: Any, data: ScanData, images: NDArray[np.int64], device: str) -> dict[str, Any]:
    """Return the answers of a network at ``PARTS`` times of the first scan of images.

    ``times_s``: seconds from the first step, shape (PARTS,). ``answers``: classes, shape (PARTS, images). ``margin``:
    largest logit minus the next one, same shape, rounded to two digits.
    """
    scans = data.first_scans(images)
    steps = [max(1, round(data.steps * part / PARTS)) for part in range(1, PARTS + 1)]
    logits = np.stack([_logits_after(count, network, data, scans, device) for count in steps])
    return course(np.array(steps) * data.step_s, logits)


def _logits_after(steps: int, network: Any, data: ScanData, scans: Any, device: str = "cpu") -> NDArray[np.float32]:
    from eskin.snn.train import logits_of

    return logits_of(network, dataclasses.replace(data, values=data.values[:, :steps], lengths=None), scans, device)


def course(times_s: NDArray[np.float64], logits: NDArray[np.floating[Any]]) -> dict[str, Any]:
    """Return times, answers and their margins for logits of shape (PARTS, images, classes)."""
    two = np.sort(logits, 2)[:, :, -2:]
    margin = (two[:, :, 1] - two[:, :, 0]).round(2)
    return {"times_s": times_s.tolist(), "answers": logits.argmax(2).tolist(), "margin": margin.tolist()}


def latency_of(cells: Cells, inner: Cells) -> dict[str, Any]:
    """Return the accuracy of a point over time, and its early answers.

    The network answers as soon as the margin of its answer reaches a threshold, at the latest at the end of the scan.
    The threshold is the one with the earliest answers in inner validation whose accuracy there is at least ``WANTED``.

    ``times_s``, ``accuracy``: shape (PARTS,). ``early``: threshold, mean time and accuracy of the early answers, or
    None if no threshold reaches ``WANTED`` in inner validation.

    - ``cells``, ``inner``: trainings with test images, and with inner validation images alone, with the fields of
      ``course``.
    """
    times_s = np.array(cells[0]["times_s"])
    right, margin = _judged(inner)
    fitting = []
    for threshold in [*np.unique(margin).tolist(), float(margin.max()) + 1]:
        first, accuracy = _answered(right, margin, threshold)
        if accuracy >= WANTED:
            fitting.append((float(times_s[first].mean()), threshold))
    right, margin = _judged(cells)
    early = None
    if fitting:
        threshold = min(fitting)[1]
        first, accuracy = _answered(right, margin, threshold)
        early = {"threshold": threshold, "mean_s": float(times_s[first].mean()), "accuracy": accuracy}
    return {"times_s": times_s.tolist(), "accuracy": right.mean(1).tolist(), "early": early}


def _judged(cells: Cells) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Return whether each answer is right, and its margin, shape (PARTS, images of all cells)."""
    right = np.concatenate([np.equal(cell["answers"], cell["labels"]) for cell in cells], 1)
    return right, np.concatenate([np.array(cell["margin"]) for cell in cells], 1)


def _answered(
    right: NDArray[np.bool_], margin: NDArray[np.float64], threshold: float
) -> tuple[NDArray[np.intp], float]:
    """Return the index of the first answer of each image whose margin suffices, else of the last; and the accuracy."""
    enough = margin >= threshold
    enough[-1] = True
    first = enough.argmax(0)
    return first, float(np.take_along_axis(right, first[None], 0).mean())


def latency_points(
    subjects: Sequence[Subject], times_s: Sequence[float], tick: Callable[[], object]
) -> list[dict[str, Any]]:
    """Return accuracy and predictions of every network at given times after the start of the scan.

    A network has seen the steps that are whole by then; before the first it has no answer, which is wrong.
    """
    answers = []
    for subject in subjects:
        data = subject.experiment.data()
        scans = data.first_scans(subject.images)
        begin_s = begin_of(subject.experiment)
        about = {name: getattr(subject, name) for name in ("network", "fold", "seed")}
        about |= {"images": data.images[scans].tolist(), "labels": data.labels[scans]}
        for time_s in times_s:
            steps = int((time_s - begin_s) / data.step_s + 1e-9)
            predicted = np.full(len(scans), -1)
            if steps > 0:
                predicted = _logits_after(steps, subject.weights.network, data, scans).argmax(1)
            answers.append(about | {"time_s": time_s, "predicted": predicted})
            tick()
    found = []
    for case, parts in by_case(answers, "network", "time_s"):
        score = score_of(parts)
        kept = {name: score[name] for name in ("accuracy", "bootstrap_95", "images")}
        found.append(case | kept | {"answers": in_words(parts)})
    return found


def begin_of(experiment: Experiment) -> float:
    """Return the time in seconds from the start of a scan to the first network step."""
    if experiment.frames is not None:
        return 0.0
    if experiment.bins.start_s is not None:
        return experiment.bins.start_s
    scan, config = experiment.scan_and_config()
    return scan.skipped_ticks(config) / config.sample_rate_hz
