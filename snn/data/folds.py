"""Divide images into stratified folds, equal for every network."""

import fnmatch
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.snn.data.scans import ScanData

INNER_FOLDS = 5
"""Number of parts of the training images; one part is the inner validation."""


def stratified_folds(
    labels: NDArray[np.int64],
    folds: int,
    seed: int = 0,
    class_names: Sequence[str] = (),
    groups: Sequence[str] = (),
) -> list[NDArray[np.int64]]:
    """Return the test images of each fold, stratified by class.

    Remaining images of a class go to the folds with the fewest images.

    Raise InputError if a class has fewer images than there are folds.

    - ``labels``: shape (images,).
    - ``folds``, ``seed``: equal seeds give equal folds.
    - ``class_names``: names of the labels, for messages.
    - ``groups``: images of one group are in one fold; by default each image is a group.
    """
    if len(set(groups)) < len(groups):
        return _grouped_folds(labels, folds, seed, groups)
    counts = np.bincount(labels)
    fewest = int(counts[counts > 0].min())
    if folds < 2:
        raise InputError(f"the number of folds must be at least 2, not {folds}")
    if folds > fewest:
        label = counts.tolist().index(fewest)
        name = class_names[label] if class_names else f"number {label}"
        raise InputError(
            f"{folds} folds need {folds} recordings or images of each class, but class {name} has {fewest}; "
            + (f"add --folds {fewest}, or record more" if fewest > 1 else "record more")
        )
    generator = np.random.default_rng([seed, folds])
    fold_of = np.empty(len(labels), np.int64)
    following = 0
    for label in range(len(counts)):
        images = generator.permutation(np.flatnonzero(labels == label))
        fold_of[images] = (following + np.arange(len(images))) % folds
        following += len(images)
    return [np.flatnonzero(fold_of == fold) for fold in range(folds)]


def _grouped_folds(labels: NDArray[np.int64], folds: int, seed: int, groups: Sequence[str]) -> list[NDArray[np.int64]]:
    """Return folds of whole groups: each group, largest first, goes where the classes become most even."""
    _, number = np.unique(groups, return_inverse=True)
    if folds < 2 or folds > number.max() + 1:
        raise InputError(
            f"{folds} folds need {folds} groups of recordings, but there are {number.max() + 1}; add --folds, record "
            f"more, or choose another --group-column"
        )
    counts = np.zeros((number.max() + 1, labels.max() + 1))
    np.add.at(counts, (number, labels), 1)
    share = counts / counts.sum(0)
    order = np.random.default_rng([seed, folds]).permutation(len(counts))
    order = order[np.argsort(-share[order].max(1), kind="stable")]
    inside, fold_of = np.zeros((folds, counts.shape[1])), np.zeros(len(counts), np.int64)
    for group in order:
        after = [
            np.square(np.delete(inside, fold, 0)).sum() + np.square(inside[fold] + share[group]).sum()
            for fold in range(folds)
        ]
        fold_of[group] = int(np.argmin(after))
        inside[fold_of[group]] += share[group]
    return [np.flatnonzero(fold_of[number] == fold) for fold in range(folds)]


def check_classes(labels: NDArray[np.int64], test: NDArray[np.int64], class_names: Sequence[str]) -> None:
    """Raise InputError if a fold leaves no image of a class for training."""
    left = set(np.delete(labels, test).tolist())
    if lacking := [name for label, name in enumerate(class_names) if label not in left]:
        raise InputError(
            f"this fold leaves no recording of {lacking[0]} for training, since its groups are together; record more "
            f"files, choose another --fold, or a shorter --window"
        )


def possible_folds(labels: NDArray[np.int64], folds: int, groups: Sequence[str] = ()) -> int:
    """Return the number of folds, fewer where a class has fewer images or groups than folds, but at least 2."""
    kinds = list(groups) if groups else list(range(len(labels)))
    fewest = min(len({kinds[n] for n in np.flatnonzero(labels == label)}) for label in np.unique(labels))
    return min(folds, max(fewest, 2))


def inner_part(
    labels: NDArray[np.int64], images: NDArray[np.int64], seed: int, groups: Sequence[str] = ()
) -> NDArray[np.int64]:
    """Return the inner validation images of a seed, from training images; ``labels``, ``groups`` are of all images."""
    inner_groups = [groups[image] for image in images] if groups else ()
    return images[stratified_folds(labels[images], INNER_FOLDS, 1, groups=inner_groups)[seed % INNER_FOLDS]]


def matching(names: Sequence[str], pattern: str) -> NDArray[np.int64]:
    """Return the indices of the names that match a pattern with ``*``, ``?`` and ``[...]``.

    Raise InputError if no name or every name fits.
    """
    fits = np.array([fnmatch.fnmatchcase(name, pattern) for name in names])
    if not fits.any() or fits.all():
        which = "all names fit" if fits.all() else "no name fits"
        raise InputError(f"{which} --test {pattern!r}; an example of a name is {names[0]}, and * stands for any text")
    return np.flatnonzero(fits)


def tested(data: ScanData, folds: int, patterns: Sequence[str]) -> list[NDArray[np.int64]]:
    """Return the test images of each fold, chosen by name patterns or stratified by class.

    Raise InputError if the patterns do not name every image exactly once.
    """
    if not patterns:
        return stratified_folds(data.image_labels, folds, class_names=data.class_names, groups=data.groups)
    found = [matching(data.names, pattern) for pattern in patterns]
    times = np.bincount(np.concatenate(found), minlength=len(data.names))
    if (wrong := np.flatnonzero(times != 1)).size:
        name, number = data.names[wrong[0]], times[wrong[0]]
        raise InputError(f"{name} fits {number} of the patterns of --test; each recording must fit exactly one")
    return found


def check_folds(data: ScanData, folds: int, patterns: Sequence[str] = ()) -> None:
    """Check that every class has enough images for all folds and their inner validation."""
    labels = data.image_labels
    for fold, test in enumerate(tested(data, folds, patterns)):
        left = np.bincount(labels) - np.bincount(labels[test], minlength=int(labels.max()) + 1)
        for label in np.unique(labels):
            if left[label] < INNER_FOLDS:
                raise InputError(
                    f"inner validation needs {INNER_FOLDS} training images of each class, but fold {fold} leaves "
                    f"{left[label]} of {data.class_names[label]}; use more images or other folds"
                )
