"""Confidence intervals of an accuracy: Wilson, and bootstrap over images and seeds."""

import math
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
