"""Measure the mean event rate of the array over a dataset, and compare the data rates of events and frames."""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.workers.engine import Local, Pool, each
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.frame_config import FrameConfig
from eskin.skin.textures.dataset import Dataset
from eskin.skin.textures.presets import Scan, Signals, quantise

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

PAPER_TAU_S = 0.2  # N-LCS time constant of the published rates in seconds, and the default of the command


@dataclass(frozen=True)
class Rates:
    """Event rates of one readout over a dataset."""

    population_rate_hz: float  # events/s of the whole array, mean over all scans
    rate_std_hz: float  # standard deviation of that rate over the scans
    events: int  # number of counted events in all scans
    clipped_samples: int  # number of samples outside full scale in all scans
    images: int
    scans: int  # one per image and start row
    scan_s: float  # mean length of a scan in seconds
    tau_s: float | None  # time constant of the integer leak; None for an encoder without a leak


def measure_rates(
    dataset: Dataset,
    scan: Scan,
    config: ReadoutConfig,
    start_rows: Sequence[float] = (0.0,),
    pool: Pool | None = None,
    progress: Callable[[], object] | None = None,
) -> Rates:
    """Return the event rates of a readout over a dataset, measured without contention.

    Raise InputError if the dataset is empty, or an image is damaged or too small.

    - ``scan``: preset, from ``eskin.skin.textures.presets.preset``.
    - ``config``: from ``scan.configure``.
    - ``start_rows``: image rows at which the array's row 0 slides, one scan each; only 0 in the ``paper`` preset.
    - ``pool``: pool for the work, by default this process; without effect on the result.
    - ``progress``: called after each image.
    """
    if not start_rows:
        raise InputError("a rate needs at least one image and one start row; the list of start rows is empty")

    results = [
        found
        for image in each_image(dataset, _rates_of, (scan, config, tuple(start_rows)), pool, progress)
        for found in image
    ]
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
        tau_s=config.tau_s if config.encoder.leaks else None,
    )


class Image(NamedTuple):
    """A texture image in the form sent to a worker process."""

    name: str
    pixels: NDArray[np.uint8]  # shape (height, width)


def _rates_of(
    image: Image, scan: Scan, config: ReadoutConfig, start_rows: Sequence[float]
) -> list[tuple[int, int, float]]:
    """Return event count, clipped samples and duration of the scans of an image."""
    scans = (scan_image(image, scan, [config], start_row) for start_row in start_rows)
    return [(int(found.counts.sum()), found.clipped, found.seconds) for found in scans]


@dataclass(frozen=True, eq=False)
class Scanned:
    """Events of one scan of one image, encoded without contention."""

    counts: NDArray[np.int64]  # counted events, shape (configurations, taxels)
    clipped: int  # samples outside full scale
    seconds: float  # length of the scan
    signals: Signals  # output of the sensors in full scale, shape (ticks, taxels)


def scan_image(image: Image, scan: Scan, configs: Sequence[ReadoutConfig], start_row: float = 0.0) -> Scanned:
    """Return the events of one scan of an image.

    - ``configs``: from ``scan.configure``; of one array, sample rate and number of bits, which share samples.
    - ``start_row``: image row at which the array's row 0 slides.
    """
    from eskin.model.taxel import count_events

    try:
        signals = scan.signals(configs[0], image.pixels, start_row)
        seconds = scan.duration_s(configs[0], image.pixels.shape)
    except InputError as error:
        raise InputError(f"image {image.name}: {error}") from None
    samples, clipped = quantise(signals, configs[0].sample_bits)
    counts = np.stack([count_events(config, samples) for config in configs])
    for found, config in zip(counts, configs, strict=True):
        if skipped := scan.skipped_ticks(config):
            found -= count_events(config, samples[:skipped])
    return Scanned(counts, clipped, seconds, signals)


Watch = Callable[[str, int], AbstractContextManager[Callable[[], object]]]
"""Takes text and number of pieces, and yields the function to call after each piece (``eskin.base.progress.bar``)."""


@contextmanager
def unwatched(text: str, total: int) -> Iterator[Callable[[], object]]:
    """Ignore progress reports."""
    yield lambda: None


def each_image(
    dataset: Dataset,
    work: Callable[..., Any],
    arguments: tuple[Any, ...],
    pool: Pool | None = None,
    progress: Callable[[], object] | None = None,
) -> Iterator[Any]:
    """Yield the result of a function for every image of a dataset, in order.

    - ``work``: takes an Image and the arguments.
    - ``pool``: pool for the work, by default this process.
    - ``progress``: called after each image.
    """
    if not len(dataset):
        raise InputError("event rates need at least one image; the dataset is empty")
    jobs = ((Image(texture.name, texture.load()), *arguments) for texture in dataset)
    # The first image fills the caches that threads then share.
    for found in itertools.chain([work(*next(jobs))], each(pool or Local(1), work, jobs)):
        if progress is not None:
            progress()
        yield found


def published_rate_hz(dataset: Dataset, scan: Scan, config: ReadoutConfig) -> float | None:
    """Return the published event rate that corresponds to a measurement, or None."""
    whole = dataset.name == "kylberg" and len(dataset) == 240
    array = (config.rows, config.columns) == (8, 8)
    tau = not config.encoder.leaks or abs(config.tau_s / PAPER_TAU_S - 1) < 0.01
    if scan.name == "paper" and whole and array and tau:
        return PUBLISHED_RATES_HZ.get((config.encoding, config.resolution))
    return None


def compare_traffic(
    textures: Dataset,
    scan: Scan,
    config: ReadoutConfig,
    frame: FrameConfig,
    tau_s: float | None = None,
    pool: Pool | None = None,
    progress: Callable[[], object] | None = None,
) -> dict[str, Any]:
    """Return the data rates of every spiking readout and of the frame readout (docs/reference/frame.md).

    - ``config``: array and resolution; every encoding is taken.
    - ``tau_s``: time constant of encoders with a leak; by default that of ``config``.
    - ``progress``: called after each texture of each readout.
    """
    configs = {
        encoding: scan.configure(config.replace(encoding=encoding), tau_s if registry.named(encoding).leaks else None)
        for encoding in registry.NAMES
    }
    return {
        "dataset": textures.name,
        "images": len(textures),
        "preset": scan.name,
        "rows": config.rows,
        "columns": config.columns,
        "resolution": config.resolution,
        "tau_s": next(one.tau_s for one in configs.values() if one.encoder.leaks),
        **{
            encoding: _of_events(one, measure_rates(textures, scan, one, pool=pool, progress=progress), frame)
            for encoding, one in configs.items()
        },
        "frame": {  # does not depend on the signal
            "words_per_s": frame.word_rate_hz,
            "bits_per_word": frame.word_bits,
            "bits_per_s": frame.bit_rate_hz,  # of the samples
            "word_bits_per_s": frame.word_rate_hz * frame.word_bits,  # with the filling of each frame's last word
            "conversions_per_taxel_per_s": frame.frame_rate_hz,
            "frame_rate_hz": frame.frame_rate_hz,
            "words_per_frame": frame.words_per_frame,
            "clock_hz": frame.clock_hz,
        },
    }


def _of_events(config: ReadoutConfig, rates: Rates, frame: FrameConfig) -> dict[str, Any]:
    """Return the data rate of a spiking readout, compared with a frame readout."""
    bits = rates.population_rate_hz * config.event_bits
    return {
        "events_per_s": rates.population_rate_hz,
        "bits_per_event": config.event_bits,
        "bits_per_s": bits,
        "events_per_taxel_per_s": rates.population_rate_hz / config.taxels,
        "ratio_to_frame": bits / frame.bit_rate_hz,
        "equal_frame_rate_hz": bits / (frame.resolution * frame.taxels),  # frames with equal N need as many bits
    }
