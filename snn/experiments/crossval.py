"""Run single trainings (fold and seed) of a cross-validation, and summarise their results.

``eskin.snn.experiments.sweep`` runs the cells.

Protocol: folds are stratified and fixed by a seed. Every cell trains twice with the same number of epochs. The first
training uses all training images, and its last epoch counts. The second leaves out an inner validation part, which
selects the epoch to evaluate. With a grid, the second training runs for every setting, and the setting with the best
inner validation is used for both. Test images select nothing.
"""

import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.snn.data.folds import inner_part, tested
from eskin.snn.data.scans import ScanData, Split
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.intervals import scored
from eskin.snn.experiments.points import READINGS, as_word


def run_cell(experiment: Experiment, data: ScanData, fold: int, seed: int, folds: int) -> dict[str, Any]:
    """Return the result of one fold and seed: predictions for the test images."""
    from eskin.snn.train import predicted_classes, train

    labels = data.image_labels
    test = tested(data, folds, experiment.tests)[fold]
    images = np.setdiff1d(np.arange(len(labels)), test)
    held_out = inner_part(labels, images, seed, data.groups)
    split = Split(data, np.setdiff1d(images, held_out), held_out, test)
    tried = [
        (train(split, made.network_config(data), made.train, seed), setting, made)
        for setting, made in experiment.settings()
    ]
    part, setting, made = max(tried, key=lambda one: float(one[0].best["held_out"]))  # the first of equal values
    whole = train(Split(data, images), made.network_config(data), made.train, seed)
    grid = {"setting": setting, "inner_accuracies": [one[0].best["held_out"] for one in tried]}
    return {
        "fold": fold,
        "seed": seed,
        "test_images": test.tolist(),
        "labels": labels[test].tolist(),
        "last": predicted_classes(whole.network, data, test).tolist(),
        "selected": part.best["predictions"],
        "selected_epoch": part.best["epoch"],
        "inner_accuracy": part.best["held_out"],
        "loss": whole.history[-1].loss,
        "train_accuracy": whole.history[-1].accuracy,
        "spikes_per_step": whole.history[-1].rate,
        **(grid if experiment.grid else {}),
    }


_one_at_a_time = threading.Lock()


def run_alone(data: ScanData, experiment: Experiment, fold: int, seed: int, folds: int) -> dict[str, Any]:
    """Return the result of one fold and seed, computed by one thread under a lock.

    Two threads on a shared machine can be far slower than one, and dropout draws from a generator that all cells of
    a process share.
    """
    import torch

    with _one_at_a_time:
        torch.set_num_threads(1)
        return run_cell(experiment, data, fold, seed, folds)


def summarise(cells: list[dict[str, Any]], images: int, classes: int) -> dict[str, Any]:
    """Return means, deviations, intervals and confusion matrices over all completed seeds.

    ``wilson_95`` uses every image once, with its mean over these seeds; ``bootstrap_95`` is over images and seeds. The
    patches of a class come from one surface, so both intervals are too narrow for another surface
    (docs/guide/classifier.md). Compare ``sd_over_cells``, over single trainings, with a published deviation over folds.
    """
    seeds, folds = (sorted({cell[name] for cell in cells}) for name in ("seed", "fold"))
    true = np.full(images, -1)
    for cell in cells:
        true[cell["test_images"]] = cell["labels"]
    result: dict[str, Any] = {"labels": as_word(true)}
    for reading in READINGS:
        classified = np.full((len(seeds), images), -1)
        accuracies = np.full((len(seeds), len(folds)), np.nan)
        confusion = np.zeros((classes, classes), np.int64)
        for cell in cells:
            seed, predicted = seeds.index(cell["seed"]), cell[reading]
            classified[seed, cell["test_images"]] = predicted
            accuracies[seed, folds.index(cell["fold"])] = np.equal(cell["labels"], predicted).mean()
            np.add.at(confusion, (cell["labels"], predicted), 1)
        of_seeds = np.nanmean(accuracies, 1)
        result[reading] = {
            **scored(((classified == true) & (classified >= 0)).T.astype(float)),
            "sd_over_folds": _deviation(np.nanmean(accuracies, 0)),
            "sd_over_seeds": _deviation(of_seeds),
            "sd_over_cells": _deviation(accuracies[~np.isnan(accuracies)]),
            "accuracy_of_seeds": of_seeds.tolist(),
            "confusion": confusion.tolist(),
            "predictions": [as_word(row) for row in classified],
        }
    return result


def _deviation(values: NDArray[np.float64]) -> float | None:
    """Return the sample standard deviation, or None for a single value."""
    return float(np.std(values, ddof=1)) if len(values) > 1 else None
