"""Cross-validation: folds x seeds, each cell a file of its own, so that a stopped run goes on where it was.

Protocol: folds are stratified and fixed by a seed. Every cell trains twice with the same budget of epochs: on all its
training images, of which the last epoch counts; and on those without an inner validation part, which selects the
epoch that counts. Test images select nothing.
"""

from __future__ import annotations

import hashlib
import json
import math
import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.errors import InputError
from model.files import atomic_write
from snn.dataset import ScanData
from snn.experiment import Experiment, stratified_folds

INNER_FOLDS = 5
"""One of so many parts of the training images is the inner validation."""

BOOTSTRAPS = 10_000


def wilson(successes: float, trials: int, z: float = 1.959964) -> tuple[float, float]:
    """Return the Wilson score interval of a proportion; by default 95 %."""
    p = successes / trials
    centre = p + z * z / (2 * trials)
    spread = z * math.sqrt(p * (1 - p) / trials + z * z / (4 * trials * trials))
    scale = 1 + z * z / trials
    return max(0.0, (centre - spread) / scale), min(1.0, (centre + spread) / scale)


def bootstrap(correct: NDArray[np.float64], seed: int = 0) -> tuple[float, float]:
    """Return the 95 % bootstrap interval of the mean over images, drawn anew with all their seeds together.

    Parameters
    ----------
    correct : shape (images,)
        Part of the seeds that classify each image rightly.
    """
    generator = np.random.default_rng(seed)
    means = [correct[generator.integers(0, len(correct), len(correct))].mean() for _ in range(BOOTSTRAPS)]
    low, high = np.percentile(means, [2.5, 97.5])
    return float(low), float(high)


def run_cell(
    experiment: Experiment, data: ScanData, fold: int, seed: int, folds: int, fold_seed: int
) -> dict[str, Any]:
    """Return the result of one fold and seed: the predictions of the test images in both readings."""
    from snn.train import predict, train

    labels = data.image_labels
    test = stratified_folds(labels, folds, fold_seed)[fold]
    images = np.setdiff1d(np.arange(len(labels)), test)
    network = experiment.network_config(data)
    whole = train(data, images, network, experiment.train, seed)
    inner = stratified_folds(labels[images], INNER_FOLDS, fold_seed + 1)[seed % INNER_FOLDS]
    held_out = images[inner]
    part = train(data, np.setdiff1d(images, held_out), network, experiment.train, seed, held_out=held_out, test=test)
    return {
        "fold": fold,
        "seed": seed,
        "test_images": test.tolist(),
        "labels": labels[test].tolist(),
        "last": predict(whole.network, data, test).tolist(),
        "selected": part.best["predictions"],
        "selected_epoch": part.best["epoch"],
        "inner_accuracy": part.best["held_out"],
        "loss": whole.history[-1].loss,
        "train_accuracy": whole.history[-1].accuracy,
        "spikes_per_step": whole.history[-1].rate,
    }


def summarise(cells: list[dict[str, Any]], images: int, classes: int) -> dict[str, Any]:
    """Return means, deviations, intervals and confusion of both readings over all cells.

    Wilson's interval takes every image once, with its mean over the seeds; the patches of a class come from one
    surface, so both intervals are too narrow for another surface (docs/classifier.md).
    """
    result: dict[str, Any] = {}
    for reading in ("last", "selected"):
        seeds = sorted({cell["seed"] for cell in cells})
        correct, seen = np.zeros(images), np.zeros(images)
        confusion = np.zeros((classes, classes), np.int64)
        by_cell = {}
        for cell in cells:
            labels, predicted = np.array(cell["labels"]), np.array(cell[reading])
            correct[cell["test_images"]] += labels == predicted
            seen[cell["test_images"]] += 1
            np.add.at(confusion, (labels, predicted), 1)
            by_cell[cell["fold"], cell["seed"]] = float((labels == predicted).mean())
        tested = seen > 0
        per_image = correct[tested] / seen[tested]
        folds = sorted({fold for fold, _ in by_cell})
        of_folds = [np.mean([by_cell[fold, seed] for seed in seeds if (fold, seed) in by_cell]) for fold in folds]
        of_seeds = [np.mean([by_cell[fold, seed] for fold in folds if (fold, seed) in by_cell]) for seed in seeds]
        accuracy = float(per_image.mean())
        result[reading] = {
            "accuracy": accuracy,
            "sd_over_folds": float(np.std(of_folds, ddof=1)) if len(of_folds) > 1 else None,
            "sd_over_seeds": float(np.std(of_seeds, ddof=1)) if len(of_seeds) > 1 else None,
            "sd_over_cells": float(np.std(list(by_cell.values()), ddof=1)) if len(by_cell) > 1 else None,
            "wilson_95": wilson(accuracy * len(per_image), len(per_image)),
            "bootstrap_95": bootstrap(per_image),
            "images": int(tested.sum()),
            "accuracy_of_seeds": [float(value) for value in of_seeds],
            "confusion": confusion.tolist(),
        }
    return result


def cross_validate(
    experiment: Experiment,
    folder: Path,
    *,
    folds: int = 6,
    seeds: int = 3,
    fold_seed: int = 0,
    workers: int = 1,
    data: ScanData | None = None,
    progress: Callable[[dict[str, Any]], object] | None = None,
) -> dict[str, Any]:
    """Run all cells that have no result yet, and return the report, which also stands in ``folder/result.json``.

    Parameters
    ----------
    experiment : Experiment
    folder : Path
        Takes one file per cell, and the report.
    folds, seeds, fold_seed : int
        Seeds are 0 .. seeds - 1.
    workers : int
        Processes of one thread each; the result does not depend on it.
    data : ScanData, optional
        The scans of the experiment, if they are there already.
    progress : callable, optional
        Called with every cell, also those found done.

    Raises
    ------
    InputError
        If the folder holds cells of another experiment.
    """
    if seeds < 1 or workers < 1:
        raise InputError(f"seeds and workers must be at least 1, not {seeds} and {workers}")
    data = experiment.data() if data is None else data
    stratified_folds(data.image_labels, folds, fold_seed)  # refuses at once
    key = experiment.to_dict() | {"folds": folds, "fold_seed": fold_seed, "data": _digest(data)}
    folder.mkdir(parents=True, exist_ok=True)
    names = {(fold, seed): folder / f"fold-{fold}-seed-{seed}.json" for seed in range(seeds) for fold in range(folds)}
    done: dict[tuple[int, int], dict[str, Any]] = {}
    for cell, path in names.items():
        if path.exists():
            done[cell] = _read_cell(path, key)
            if progress is not None:
                progress(done[cell])

    def finish(result: dict[str, Any]) -> None:
        cell = (result["fold"], result["seed"])
        _write_json(names[cell], {"experiment": key, "result": result})
        done[cell] = result
        if progress is not None:
            progress(result)

    missing = [cell for cell in names if cell not in done]
    if workers == 1 or len(missing) < 2:
        for fold, seed in missing:
            finish(run_cell(experiment, data, fold, seed, folds, fold_seed))
    else:
        _run_parallel(experiment, data, missing, folds, fold_seed, workers, finish)
    cells = [done[cell] for cell in names]
    report = {
        "experiment": key,
        "seeds": seeds,
        "rate_hz": data.rate_hz,
        "class_names": list(data.class_names),
        **summarise(cells, len(data.names), len(data.class_names)),
        "cells": cells,
    }
    _write_json(folder / "result.json", report)
    return report


# -- processes and files -----------------------------------------------------------------------------

_shared: tuple[Experiment, ScanData, int, int] | None = None


def _start(experiment: Experiment, data: ScanData, folds: int, fold_seed: int) -> None:
    """Keep what all cells of a process share; two threads on a shared machine can be far slower than one."""
    import torch

    global _shared
    torch.set_num_threads(1)
    _shared = (experiment, data, folds, fold_seed)


def _work(fold: int, seed: int) -> dict[str, Any]:
    assert _shared is not None
    experiment, data, folds, fold_seed = _shared
    return run_cell(experiment, data, fold, seed, folds, fold_seed)


def _run_parallel(
    experiment: Experiment,
    data: ScanData,
    cells: list[tuple[int, int]],
    folds: int,
    fold_seed: int,
    workers: int,
    finish: Callable[[dict[str, Any]], None],
) -> None:
    """Run cells in processes and hand each result over as it comes."""
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, context, _start, (experiment, data, folds, fold_seed))
    try:
        for future in as_completed([pool.submit(_work, fold, seed) for fold, seed in cells]):
            finish(future.result())
    finally:
        pool.shutdown(cancel_futures=True)


def _digest(data: ScanData) -> str:
    digest = hashlib.sha256(np.ascontiguousarray(data.values).tobytes())
    digest.update(data.labels.tobytes() + data.images.tobytes())
    return digest.hexdigest()


def _read_cell(path: Path, key: dict[str, Any]) -> dict[str, Any]:
    """Return the result of a finished cell, or refuse one of another experiment."""
    try:
        content = json.loads(path.read_text())
        found, result = content["experiment"], content["result"]
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(f"{path} is not the result of a cell; remove it") from None
    if found != json.loads(json.dumps(key)):
        names = [name for name in key if found.get(name) != json.loads(json.dumps(key[name]))]
        raise InputError(
            f"{path} is of another experiment (different: {', '.join(names)}); remove the folder or choose another"
        )
    if not isinstance(result, dict):
        raise InputError(f"{path} is not the result of a cell; remove it")
    return result


def _write_json(path: Path, content: dict[str, Any]) -> None:
    with atomic_write(path) as file:
        file.write((json.dumps(content, indent=1) + "\n").encode())
