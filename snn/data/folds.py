"""Divide images into stratified folds, equal for every network."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.snn.data.scans import ScanData

INNER_FOLDS = 5
"""One of so many parts of the training images is the inner validation."""


def stratified_folds(labels: NDArray[np.int64], folds: int, seed: int = 0) -> list[NDArray[np.int64]]:
    """Return the test images of each fold, stratified by class.

    Remaining images of a class go to the folds with the fewest images.

    Parameters
    ----------
    labels : shape (images,)
    folds, seed : int
        Equal seeds give equal folds.
    """
    counts = np.bincount(labels)
    fewest = int(counts[counts > 0].min())
    if not 2 <= folds <= fewest:
        raise InputError(f"the number of folds must be in 2..{fewest}, the images of the smallest class, not {folds}")
    generator = np.random.default_rng([seed, folds])
    fold_of = np.empty(len(labels), np.int64)
    following = 0
    for label in range(len(counts)):
        images = generator.permutation(np.flatnonzero(labels == label))
        fold_of[images] = (following + np.arange(len(images))) % folds
        following += len(images)
    return [np.flatnonzero(fold_of == fold) for fold in range(folds)]


def check_folds(data: ScanData, folds: int, fold_seed: int) -> None:
    """Check that every class has enough images for all folds and their inner validation."""
    labels = data.image_labels
    for fold, test in enumerate(stratified_folds(labels, folds, fold_seed)):
        left = np.bincount(labels) - np.bincount(labels[test], minlength=int(labels.max()) + 1)
        for label in np.unique(labels):
            if left[label] < INNER_FOLDS:
                raise InputError(
                    f"inner validation needs {INNER_FOLDS} training images of each class, but fold {fold} leaves "
                    f"{left[label]} of {data.class_names[label]}; use more images or other folds"
                )
