"""The mean event rate of the whole taxel array over a dataset."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from model.config import ReadoutConfig
from model.errors import InputError
from model.textures.dataset import Dataset, Texture
from model.textures.presets import Scan

PUBLISHED_RATES_HZ = {
    ("lcs", 2): 2429.48,
    ("lcs", 4): 20338.54,
    ("lcs", 6): 99110.85,
    ("lcs", 8): 400133.97,
    ("nlcs", 4): 3009.60,
    ("nlcs", 6): 12359.05,
    ("nlcs", 8): 49640.13,
    ("nlcs", 10): 199268.60,
}
"""Published events/s of 8 x 8 taxels, mean of 240 Kylberg images, by encoding and resolution (tau 200 ms)."""

PAPER_TAU_S = 0.2
"""N-LCS time constant of the published rates in seconds, and the default of the command."""


@dataclass(frozen=True)
class Rates:
    """Event rates of one readout over a dataset.

    Attributes
    ----------
    population_rate_hz : float
        Events/s of the whole array, mean over all scans.
    rate_std_hz : float
        Standard deviation of that rate over the scans.
    events : int
        Events that count, all scans together.
    clipped_samples : int
        Samples outside full scale, all scans together.
    images, scans : int
        Number of images, and of scans: one per image and start row.
    scan_s : float
        Mean length of a scan in seconds.
    tau_s : float or None
        N-LCS: the time constant that the integers give; None for the other encodings.
    """

    population_rate_hz: float
    rate_std_hz: float
    events: int
    clipped_samples: int
    images: int
    scans: int
    scan_s: float
    tau_s: float | None


def measure_rates(
    dataset: Dataset,
    scan: Scan,
    config: ReadoutConfig,
    start_rows: Sequence[float] = (0.0,),
    workers: int = 1,
    progress: Callable[[], object] | None = None,
) -> Rates:
    """Return the event rates of a readout over a dataset, with every request taken at once.

    Parameters
    ----------
    dataset : Dataset
    scan : Scan
        Preset, from ``model.textures.presets.preset``.
    config : ReadoutConfig
        From ``scan.configure``.
    start_rows : sequence of float
        Image rows at which the array's row 0 slides, one scan each; only 0 in the ``paper`` preset.
    workers : int
        Threads to work with; the result does not depend on it.
    progress : callable, optional
        Called after each image.

    Raises
    ------
    InputError
        If the dataset is empty, an image is damaged or too small, or workers is less than 1.
    """
    import numpy as np

    if workers < 1:
        raise InputError(f"the number of workers must be at least 1, not {workers}")
    if not len(dataset) or not start_rows:
        raise InputError("a rate needs at least one image and one start row; the dataset or the list is empty")

    def one(texture: Texture) -> list[tuple[int, int, float]]:
        found = _scan_texture(texture, scan, config, start_rows)
        if progress is not None:
            progress()
        return found

    # The first image fills the caches that the threads then share.
    results = one(dataset[0])
    pool = ThreadPoolExecutor(workers)
    try:
        for found in pool.map(one, dataset[1:]):
            results += found
    finally:
        pool.shutdown(cancel_futures=True)
    events, clipped, seconds = (np.array(column) for column in zip(*results, strict=True))
    rates = events / seconds
    return Rates(
        population_rate_hz=float(rates.mean()),
        rate_std_hz=float(rates.std()),
        events=int(events.sum()),
        clipped_samples=int(clipped.sum()),
        images=len(dataset),
        scans=len(results),
        scan_s=math.fsum(seconds) / len(seconds),
        tau_s=config.tau_s if config.encoding == "nlcs" else None,
    )


def _scan_texture(
    texture: Texture, scan: Scan, config: ReadoutConfig, start_rows: Sequence[float]
) -> list[tuple[int, int, float]]:
    """Return events, clipped samples and length in seconds of the scans of one image."""
    import numpy as np

    from model.taxel import encode

    image = texture.load()
    skipped = scan.skipped_ticks(config)
    results = []
    for start_row in start_rows:
        try:
            samples, clipped = scan.samples(config, image, start_row)
            seconds = scan.duration_s(config, image.shape)
        except InputError as error:
            raise InputError(f"image {texture.name}: {error}") from None
        counts = encode(config, samples)[skipped:]
        results.append((int(np.abs(counts).sum(dtype=np.int64)), clipped, seconds))
    return results


def published_rate_hz(dataset: Dataset, scan: Scan, config: ReadoutConfig) -> float | None:
    """Return the published rate that a measurement should give, or None if it is of something else."""
    whole = dataset.name == "kylberg" and len(dataset) == 240
    array = (config.rows, config.columns) == (8, 8)
    tau = config.encoding != "nlcs" or abs(config.tau_s / PAPER_TAU_S - 1) < 0.01
    if scan.name == "paper" and whole and array and tau:
        return PUBLISHED_RATES_HZ.get((config.encoding, config.resolution))
    return None


# -- the command -------------------------------------------------------------------------------------
