"""Train one network on one fold, and write its result and weights."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.files import write_json
from eskin.skin.recordings.event_files import signal_statistics
from eskin.snn.checkpoint import Checkpoint, fingerprint, own_checkpoint
from eskin.snn.data.folds import check_classes, matching, possible_folds, stratified_folds
from eskin.snn.data.recordings import own_readout
from eskin.snn.data.scans import ScanData, Split
from eskin.snn.exchange.weights import Weights, save_weights
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.reference import references, score
from eskin.snn.train import predicted_classes, train
from eskin.snn.training import Epoch, Training


@dataclass(frozen=True)
class Fold:
    """Training and test images of one fold of a cross-validation."""

    data: ScanData
    number: int
    of: int
    """Number of the test fold, from 0, and number of folds; 0 and 1 for a test set selected by names."""
    test: NDArray[np.int64]
    images: NDArray[np.int64]
    """Test images and training images."""

    @classmethod
    def choose(cls, data: ScanData, number: int, of: int) -> Fold:
        """Return a stratified fold of a dataset."""
        of = possible_folds(data.image_labels, of, data.groups)
        if number >= of:
            raise InputError(f"fold must be in 0..{of - 1}, not {number}")
        test = stratified_folds(data.image_labels, of, class_names=data.class_names, groups=data.groups)[number]
        check_classes(data.image_labels, test, data.class_names)
        return cls(data, number, of, test, np.setdiff1d(np.arange(len(data.image_labels)), test))

    @classmethod
    def named(cls, data: ScanData, pattern: str) -> Fold:
        """Return the fold whose test images have names that match a pattern with ``*`` and ``?``.

        Raise InputError if none or all fit, or the others lack a class.
        """
        test = matching(data.names, pattern)
        images = np.setdiff1d(np.arange(len(data.names)), test)
        labels = data.image_labels
        if lacking := set(labels[test].tolist()) - set(labels[images].tolist()):
            name = data.class_names[min(lacking)]
            raise InputError(f"--test {pattern!r} leaves no recording of {name} for training; test fewer")
        return cls(data, 0, 1, test, images)


def train_fold(
    experiment: Experiment,
    fold: Fold,
    seed: int,
    checkpoint: Checkpoint,
    *,
    device: str = "cpu",
    watch_test: bool = False,
    progress: Callable[[Epoch], None] | None = None,
    more: dict[str, Any] | None = None,
) -> tuple[Training, dict[str, Any]]:
    """Train a network on a fold, and write ``result.json`` and ``weights.npz``.

    Return the trained network with its history, and the content of ``result.json``.

    - ``experiment``: its grid is not used.
    - ``seed``: seed of weights, order and augmentation.
    - ``checkpoint``: its folder also gets result and weights.
    - ``device``: device name of torch.
    - ``watch_test``: also note the test accuracy of every epoch, which selects nothing.
    - ``progress``: called after each epoch.
    - ``more``: other entries of ``result.json``.
    """
    out = checkpoint.path.parent
    data, labels = fold.data, fold.data.image_labels[fold.test]
    training = train(
        Split(data, fold.images, fold.test if watch_test else None),
        experiment.network_config(data),
        experiment.train,
        seed,
        progress=progress,
        checkpoint=checkpoint,
        device=device,
    )
    predicted = predicted_classes(training.network, data, fold.test, device)
    result = {
        "experiment": experiment.to_dict(),
        "fold": fold.number,
        "folds": fold.of,
        "seed": seed,
        "class_names": list(data.class_names),
        **score(labels, predicted),
        "labels": labels.tolist(),
        "predicted": predicted.tolist(),
        "history": [dataclasses.asdict(epoch) for epoch in training.history],
        **(more or {}),
    }
    if fold.of == 1 or data.groups:
        result["test_images"] = fold.test.tolist()
    if experiment.events and (own := own_readout(Path(experiment.events))):
        result["recordings"] = own.to_dict()
        signals = signal_statistics(Path(experiment.events), data.names)
        result["references"] = references(data, fold.images, fold.test, signals)
    write_json(out / "result.json", result)
    save_weights(out / "weights.npz", Weights(training.network, data.class_names, data.step_s))
    return training, result


def check_whole(experiment: Experiment, data: ScanData, seed: int, checkpoint: Checkpoint) -> None:
    """Raise InputError if there is a checkpoint of another training than ``train_whole``."""
    if checkpoint.path.exists():
        split = Split(data, np.arange(len(data.names)))
        key = fingerprint(split, experiment.network_config(data), experiment.train, seed)
        own_checkpoint(checkpoint.path, key)


def train_whole(
    experiment: Experiment,
    data: ScanData,
    seed: int,
    checkpoint: Checkpoint,
    tested: dict[str, Any],
    *,
    device: str = "cpu",
    progress: Callable[[Epoch], None] | None = None,
) -> None:
    """Train a network on all recordings, and write ``weights.npz``, and a ``result.json`` without test recordings.

    ``tested`` is the result of ``train_fold`` with the same settings; the other parameters are those of ``train_fold``.
    """
    out = checkpoint.path.parent
    training = train(
        Split(data, np.arange(len(data.names))),
        experiment.network_config(data),
        experiment.train,
        seed,
        progress=progress,
        checkpoint=checkpoint,
        device=device,
    )
    whole = {"fold": 0, "folds": 1, "labels": [], "predicted": [], "test_images": []}
    whole |= {"history": [dataclasses.asdict(epoch) for epoch in training.history]}
    scores = {name: tested[name] for name in ("accuracy", "balanced_accuracy", "right")}
    kept = {name: value for name, value in tested.items() if name not in {*scores, "references"}}
    write_json(out / "result.json", kept | whole | {"tested_fold": scores | {"of": len(tested["labels"])}})
    save_weights(out / "weights.npz", Weights(training.network, data.class_names, data.step_s))
