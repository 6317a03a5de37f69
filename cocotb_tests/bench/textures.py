"""Scans over the embedded photographs for tests."""

import functools

import numpy as np
from numpy.typing import NDArray

from eskin.model.config import ReadoutConfig
from eskin.skin.textures.dataset import embedded_dataset
from eskin.skin.textures.physical import PhysicalScan, large_enough


@functools.lru_cache(maxsize=4)
def scan(rows: int, columns: int, sample_bits: int, number: int) -> NDArray[np.int32]:
    """Return the codes of a scan of one embedded texture, shape (ticks, taxels)."""
    config = ReadoutConfig(rows=rows, columns=columns, sample_bits=sample_bits)
    dataset = embedded_dataset()
    samples, _ = PhysicalScan().samples(config, large_enough(dataset[number % len(dataset)].load(), config))
    return samples


def random_scan(config: ReadoutConfig, ticks: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return a random section of a scan over an embedded photograph, shape (ticks, taxels).

    Signals are scaled to 90 % of full scale, so that even the coarsest resolution detects them.
    """
    samples = scan(config.rows, config.columns, config.sample_bits, int(rng.integers(4)) * 11)
    start = int(rng.integers(0, max(len(samples) - ticks, 1)))
    window = samples[start : start + ticks].astype(np.int64)
    return window * (config.full_scale * 9 // 10) // max(int(np.abs(window).max()), 1)
