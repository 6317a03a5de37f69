"""Choose settings of a training by short trainings on a part of the training recordings."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.snn.data.folds import INNER_FOLDS, possible_folds, stratified_folds
from eskin.snn.data.scans import ScanData, Split
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.network_config import NetworkConfig
from eskin.snn.training import TrainConfig

SHARES = (8, 4)
"""Parts of the epochs in each round; after a round, the better half of the candidates remains, until one is left."""

LEAST_FOLDS = 4
"""Least parts into which the training recordings are divided; one is set apart."""

FEW, REPEATS = 100, 3
"""With groups, or up to ``FEW`` training recordings, one part is too small a sample: so many parts judge in turn."""


def choose(
    candidates: Sequence[Experiment],
    data: Callable[[Experiment], ScanData],
    images: NDArray[np.int64],
    seed: int,
    told: Callable[[str], None] = print,
) -> tuple[Experiment, list[dict[str, Any]]]:
    """Return the candidate that classifies the inner validation part best, and the scores of all short trainings.

    The number of correct recordings decides, then fixed decays, which need no memory in the hardware, then the log
    loss; with groups or few recordings, the log loss alone. The first candidate wins where a class has fewer than
    ``LEAST_FOLDS`` recordings or groups.

    - ``data``: returns the scans of a candidate.
    - ``images``: training recordings.
    - ``told``: called with a line for every short training.
    """
    first = data(candidates[0])
    labels, groups = first.image_labels, first.groups
    of_images = [groups[image] for image in images] if groups else ()
    folds = possible_folds(labels[images], INNER_FOLDS, of_images)
    if len(candidates) == 1 or folds < LEAST_FOLDS:
        return candidates[0], []
    all_parts = [images[part] for part in stratified_folds(labels[images], folds, 1, groups=of_images)]
    left, scores, turns = list(range(len(candidates))), [], repeats(len(images), bool(groups))
    for number, share in enumerate(SHARES):
        if len(left) == 1:
            break
        parts, ranked = [all_parts[(seed + number + turn) % folds] for turn in range(turns)], []
        for candidate in left:
            made = candidates[candidate]
            scans = data(made)
            short = dataclasses.replace(made.train, epochs=max(made.train.epochs // share, 1))
            network = made.network_config(scans)
            found = [judged(scans, np.setdiff1d(images, part), part, network, short, seed) for part in parts]
            right, loss, of = pooled(found, parts)
            score = {"bin_s": made.bins.bin_s, "learn_decay": bool(made.network.get("learn_decay", False))}
            score |= {"window_steps": made.train.window_steps} if made.train.window_steps else {}
            scores.append(score | {"epochs": short.epochs, "right": right, "of": of, "log_loss": loss})
            told(f"inner validation: {described(made)}, {short.epochs} epochs: {right} of {of}, log loss {loss:.3f}")
            ranked.append(((-right, score["learn_decay"], loss) if turns == 1 else (loss,), candidate))
        left = [candidate for _, candidate in sorted(ranked)[: -(-len(left) // 2)]]
    return candidates[left[0]], scores


def described(made: Experiment) -> str:
    """Return the settings of an experiment that inner validation chooses, as text."""
    decays = "learned" if made.network.get("learn_decay") else "fixed"
    windows = f", windows of {made.train.window_steps * made.bins.bin_s:.3g} s" if made.train.window_steps else ""
    return f"time bin {1e3 * made.bins.bin_s:.4g} ms, {decays} decays{windows}"


def repeats(recordings: int, grouped: bool) -> int:
    """Return how many parts of the training recordings judge in a round."""
    return REPEATS if grouped or recordings <= FEW else 1


def pooled(found: Sequence[tuple[int, float]], parts: Sequence[NDArray[np.int64]]) -> tuple[int, float, int]:
    """Return the number of correct recordings of all parts, the mean log loss, and the number of recordings."""
    sizes = [len(part) for part in parts]
    right, losses = zip(*found, strict=True)
    return sum(right), float(np.average(losses, weights=sizes)), sum(sizes)


def judged(
    data: ScanData,
    learned: NDArray[np.int64],
    part: NDArray[np.int64],
    network: NetworkConfig,
    training: TrainConfig,
    seed: int,
) -> tuple[int, float]:
    """Return the number of correct recordings of a part, and their log loss, after a training on others."""
    from scipy.special import log_softmax

    from eskin.snn.train import logits_of, train

    done, labels = train(Split(data, learned), network, training, seed), data.image_labels[part]
    logits = logits_of(done.network, data, data.first_scans(part)).astype(float)
    return int((logits.argmax(1) == labels).sum()), -float(log_softmax(logits, 1)[np.arange(len(part)), labels].mean())
