"""The mean event rate of the whole taxel array over a dataset."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from model.config import ReadoutConfig
from model.errors import InputError
from model.textures.dataset import Dataset, Texture
from model.textures.presets import Scan, Signals, quantise

Result = TypeVar("Result")

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
    if not start_rows:
        raise InputError("a rate needs at least one image and one start row; the list of start rows is empty")

    def work(texture: Texture) -> list[tuple[int, int, float]]:
        scans = (scan_texture(texture, scan, [config], start_row) for start_row in start_rows)
        return [(int(found.counts.sum()), found.clipped, found.seconds) for found in scans]

    results = [found for image in each_texture(dataset, work, workers, progress) for found in image]
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


@dataclass(frozen=True, eq=False)
class Scanned:
    """One scan of one image, encoded with every request taken at once.

    Attributes
    ----------
    counts : int64 array, shape (configurations, taxels)
        Events that count, of every configuration and taxel.
    clipped : int
        Samples outside full scale.
    seconds : float
        Length of the scan.
    signals : float64 array, shape (ticks, taxels)
        Output of the sensors in full scale.
    """

    counts: NDArray[np.int64]
    clipped: int
    seconds: float
    signals: Signals


def scan_texture(texture: Texture, scan: Scan, configs: Sequence[ReadoutConfig], start_row: float = 0.0) -> Scanned:
    """Return the events of one scan of an image.

    Parameters
    ----------
    texture : Texture
    scan : Scan
    configs : sequence of ReadoutConfig
        From ``scan.configure``; of one array, sample rate and number of bits, since they share their samples.
    start_row : float
        Image row at which the array's row 0 slides.
    """
    from model.taxel import count_events

    image = texture.load()
    try:
        signals = scan.signals(configs[0], image, start_row)
        seconds = scan.duration_s(configs[0], image.shape)
    except InputError as error:
        raise InputError(f"image {texture.name}: {error}") from None
    samples, clipped = quantise(signals, configs[0].sample_bits)
    counts = np.stack([count_events(config, samples) for config in configs])
    for found, config in zip(counts, configs, strict=True):
        if skipped := scan.skipped_ticks(config):
            found -= count_events(config, samples[:skipped])
    return Scanned(counts, clipped, seconds, signals)


Watch = Callable[[str, int], AbstractContextManager[Callable[[], object]]]
"""Takes what is done and its number of pieces, and gives what to call after each, as ``model.cli.progress.bar``."""


@contextmanager
def unwatched(text: str, total: int) -> Iterator[Callable[[], object]]:
    """Show nothing."""
    yield lambda: None


def each_texture(
    dataset: Dataset,
    work: Callable[[Texture], Result],
    workers: int = 1,
    progress: Callable[[], object] | None = None,
) -> Iterator[Result]:
    """Give what a function makes of every image, in their order, worked out by threads.

    Parameters
    ----------
    dataset : Dataset
    work : callable
        Takes a texture.
    workers : int
        Threads; the results do not depend on them.
    progress : callable, optional
        Called after each image.
    """
    if workers < 1:
        raise InputError(f"the number of workers must be at least 1, not {workers}")
    if not len(dataset):
        raise InputError("event rates need at least one image; the dataset is empty")

    def one(texture: Texture) -> Result:
        found = work(texture)
        if progress is not None:
            progress()
        return found

    # The first image fills the caches that the threads then share.
    yield one(dataset[0])
    pool = ThreadPoolExecutor(workers)
    try:
        yield from pool.map(one, dataset[1:])
    finally:
        pool.shutdown(cancel_futures=True)


def published_rate_hz(dataset: Dataset, scan: Scan, config: ReadoutConfig) -> float | None:
    """Return the published rate that a measurement should give, or None if it is of something else."""
    whole = dataset.name == "kylberg" and len(dataset) == 240
    array = (config.rows, config.columns) == (8, 8)
    tau = config.encoding != "nlcs" or abs(config.tau_s / PAPER_TAU_S - 1) < 0.01
    if scan.name == "paper" and whole and array and tau:
        return PUBLISHED_RATES_HZ.get((config.encoding, config.resolution))
    return None
