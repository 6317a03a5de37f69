"""Measure the accuracy of a network during a touch (docs/results/what_events_are_good_for.md)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

from eskin.snn.data.scans import ScanData
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.intervals import bootstrap
from eskin.snn.experiments.points import as_word
from eskin.snn.experiments.robustness import Subject
from eskin.snn.studies.paired import right_of

Points = list[dict[str, Any]]


def latency_points(subjects: Sequence[Subject], times_s: Sequence[float], tick: Callable[[], object]) -> Points:
    """Return accuracy and predictions of every network at given times after the start of the scan.

    A network has seen the steps that are whole by then; before the first it has no answer, which is wrong.
    """
    found: dict[tuple[str, float], list[dict[str, Any]]] = {}
    for subject in subjects:
        data = subject.experiment.data()
        scans = data.scans_of(subject.images, first_row_only=True)
        begin_s = begin_of(subject.experiment)
        labels = as_word(data.labels[scans])
        for time_s in times_s:
            steps = int((time_s - begin_s) / data.step_s + 1e-9)
            predicted = _answers(subject, data, scans, min(steps, data.steps)) if steps > 0 else "." * len(scans)
            answer = {"fold": subject.fold, "seed": subject.seed, "images": data.images[scans].tolist()}
            found.setdefault((subject.network, time_s), []).append(answer | {"labels": labels, "predicted": predicted})
            tick()
    return [_point(network, time_s, answers) for (network, time_s), answers in found.items()]


def _answers(subject: Subject, data: ScanData, scans: Any, steps: int) -> str:
    from eskin.snn.train import logits_of

    begun = dataclasses.replace(data, values=data.values[:, :steps])
    return as_word(logits_of(subject.weights.network, begun, scans).argmax(1))


def begin_of(experiment: Experiment) -> float:
    """Return the time in seconds from the start of a scan to the first network step."""
    if experiment.frames is not None:
        return 0.0
    if experiment.bins.start_s is not None:
        return experiment.bins.start_s
    scan, config = experiment.scan_and_config()
    return scan.skipped_ticks(config) / config.sample_rate_hz


def _point(network: str, time_s: float, answers: Points) -> dict[str, Any]:
    right = right_of(answers)
    return {
        "network": network,
        "time_s": time_s,
        "accuracy": float(right.mean()),
        "bootstrap_95": bootstrap(right[:, None]),
        "images": len(right),
        "answers": answers,
    }
