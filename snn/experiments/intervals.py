"""Confidence intervals of an accuracy: Wilson, and bootstrap over images and seeds; comparison with references."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

BOOTSTRAPS = 10_000


def wilson(successes: float, trials: int) -> tuple[float, float]:
    """Return the 95 % Wilson score interval of a proportion.

    Of an accuracy it says what new images would give with these same seeds: the variance over seeds is not in it.
    """
    p, z = successes / trials, 1.959964
    centre = p + z * z / (2 * trials)
    spread = z * math.sqrt(p * (1 - p) / trials + z * z / (4 * trials * trials))
    scale = 1 + z * z / trials
    return max(0.0, (centre - spread) / scale), min(1.0, (centre + spread) / scale)


def bootstrap(correct: NDArray[np.float64]) -> tuple[float, float]:
    """Return the 95 % bootstrap interval of the mean, resampled over images and seeds.

    The interval covers new images and new seeds; with one seed, only new images. With two or three seeds the variation
    between seeds is underestimated. If all images are right, the interval is empty.

    ``correct``: shape (images, seeds); 1 if the network of a seed classifies an image correctly, else 0; or the
    difference of two networks.
    """
    images, seeds = correct.shape
    generator = np.random.default_rng(0)
    rows = generator.multinomial(images, np.full(images, 1 / images), BOOTSTRAPS)  # how often each image is drawn
    columns = generator.multinomial(seeds, np.full(seeds, 1 / seeds), BOOTSTRAPS)
    means = (rows @ correct * columns).sum(1) / correct.size
    low, high = np.percentile(means, [2.5, 97.5])
    return float(low), float(high)


def scored(correct: NDArray[np.float64]) -> dict[str, Any]:
    """Return accuracy, intervals and number of images, for the array ``correct`` of ``bootstrap``.

    Wilson's interval uses every image once, with its mean over the seeds.
    """
    images = len(correct)
    return {
        "accuracy": float(correct.mean()),
        "wilson_95": wilson(float(correct.mean()) * images, images),
        "bootstrap_95": bootstrap(correct),
        "images": images,
    }


WORDS = {
    "events": "logistic regression on statistics of the network's inputs",
    "signals": "logistic regression on statistics of the signals",
    "forest": "forest on statistics of the signals",
    "most frequent class": "always the most frequent class",
}
"""Names of the references."""


def sentences(result: dict[str, Any], unbalanced: bool) -> Sequence[str]:
    """Return sentences that compare the accuracy of a network with the references of its ``result.json``.

    The network is called worse than the best reference if the 95 % bootstrap interval of their difference over the
    test recordings does not contain 0.
    """
    labels, found = np.array(result["labels"]), result["references"]
    lines = []
    for name, one in found.items():
        more = f", balanced {one['balanced_accuracy']:.1%}" if unbalanced else ""
        lines.append(f"{WORDS[name]}: {one['accuracy']:.1%} ({one['right']} of {len(labels)}{more})")
    best = max(found, key=lambda name: found[name]["accuracy"])
    right = {name: np.array(one["predicted"]) == labels for name, one in {**found, "": result}.items()}
    low, high = bootstrap((right[best].astype(float) - right[""])[:, None])
    if low > 0:
        lines.append(
            f"the network is worse than the {WORDS[best].removeprefix('always the ')}, by {100 * low:.1f} to "
            f"{100 * high:.1f} points (95 % interval); let networks of several --seed vote, or use that reference"
        )
    return lines
