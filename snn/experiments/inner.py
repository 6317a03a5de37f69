"""Choose settings of a training by short trainings on a part of the training recordings."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.snn.data.folds import INNER_FOLDS, inner_part, possible_folds
from eskin.snn.data.scans import ScanData, Split
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.network_config import NetworkConfig
from eskin.snn.training import TrainConfig

SHARES = (8, 4)
"""Parts of the epochs in each round; after a round, the better half of the candidates remains, until one is left."""


def choose(
    candidates: Sequence[Experiment],
    data: Callable[[Experiment], ScanData],
    images: NDArray[np.int64],
    seed: int,
    told: Callable[[str], None] = print,
) -> tuple[Experiment, list[dict[str, Any]]]:
    """Return the candidate that classifies the inner validation part best, and the scores of all short trainings.

    The number of correct recordings decides, then fixed decays, which need no memory in the hardware, then the log
    loss. The first candidate wins where a class has one recording or group.

    - ``data``: returns the scans of a candidate.
    - ``images``: training recordings.
    - ``told``: called with a line for every short training.
    """
    first = data(candidates[0])
    labels, groups = first.image_labels, first.groups
    of_images = [groups[image] for image in images] if groups else ()
    if len(candidates) == 1 or possible_folds(labels[images], INNER_FOLDS, of_images) < INNER_FOLDS:
        return candidates[0], []
    left, scores = list(range(len(candidates))), []
    for number, share in enumerate(SHARES):
        if len(left) == 1:
            break
        part = inner_part(labels, images, seed + number, groups)
        learned, ranked = np.setdiff1d(images, part), []
        for candidate in left:
            made = candidates[candidate]
            scans = data(made)
            short = dataclasses.replace(made.train, epochs=max(made.train.epochs // share, 1))
            right, loss = judged(scans, learned, part, made.network_config(scans), short, seed)
            score = {"bin_s": made.bins.bin_s, "learn_decay": bool(made.network.get("learn_decay", False))}
            scores.append(score | {"epochs": short.epochs, "right": right, "of": len(part), "log_loss": loss})
            decays = "learned" if score["learn_decay"] else "fixed"
            told(
                f"inner validation: time bin {1e3 * made.bins.bin_s:.4g} ms, {decays} decays, {short.epochs} epochs: "
                f"{right} of {len(part)}, log loss {loss:.3f}"
            )
            ranked.append((-right, score["learn_decay"], loss, candidate))
        left = [candidate for *_, candidate in sorted(ranked)[: -(-len(left) // 2)]]
    return candidates[left[0]], scores


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
