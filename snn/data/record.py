"""Texture scans as ``ScanData``: events of the clock-by-clock model, or frames for the baselines."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from model.config import ReadoutConfig
from model.errors import InputError
from model.events.recording import Recording
from model.textures.dataset import Dataset, Texture
from model.textures.presets import Scan
from snn.data.bins import BinConfig
from snn.data.scans import ScanData, collect

Tick = Callable[[], object]
"""Called after each scan or recording that is done."""


def record(texture: Texture, dataset_name: str, scan: Scan, config: ReadoutConfig, start_row: float = 0.0) -> Recording:
    """Return what the clock-by-clock model of the readout sends while a texture is scanned.

    The recording has the events and the metadata of an RTL replay but ``source``, which is "model".
    """
    from model.readout import Stimulus, simulate

    try:
        samples, clipped = scan.samples(config, texture.load(), start_row)
    except InputError as error:
        raise InputError(f"image {texture.name}: {error}") from None
    stimulus = Stimulus.from_samples(config, samples)
    metadata = {
        "name": texture.name,
        "class": texture.class_name,
        "label": texture.label,
        "dataset": dataset_name,
        "preset": scan.name,
        "start_row": start_row,
        "clipped_samples": clipped,
        "source": "model",
    }
    return Recording(simulate(config, stimulus), config, stimulus.clocks, metadata=metadata)


def record_dataset(
    dataset: Dataset,
    scan: Scan,
    config: ReadoutConfig,
    bins: BinConfig,
    start_rows: Sequence[float] = (0.0,),
    progress: Tick | None = None,
) -> ScanData:
    """Return the event counts of all textures, one scan per start row, from the clock-by-clock model.

    Parameters
    ----------
    dataset, scan, config
        ``config`` from ``scan.configure``.
    bins : BinConfig
    start_rows : sequence of float
        Image rows of the array's top edge, in pixels; only 0 in the ``paper`` preset.
    progress : callable, optional
        Called after each scan.
    """
    recordings = []
    for texture in dataset:
        for start_row in start_rows:
            recordings.append(record(texture, dataset.name, scan, config, start_row))
            if progress is not None:
                progress()
    return collect(recordings, bins, dataset.class_names)


@dataclass(frozen=True, kw_only=True)
class FrameSteps:
    """Frames of all taxels, as one shared converter gives them.

    Parameters
    ----------
    rate_hz : float
        Frames per second (paper: 5 kHz).
    bits : int
        Bits of a sample (paper: 10).
    frames_per_step : int
        So many frames side by side are one time step of the network: channels are taxels * frames_per_step.
    """

    rate_hz: float = 5000.0
    bits: int = 10
    frames_per_step: int = 20

    def __post_init__(self) -> None:
        if not (math.isfinite(self.rate_hz) and self.rate_hz > 0):
            raise InputError(f"rate_hz must be a positive number of hertz, not {self.rate_hz!r}")
        for name, least in (("bits", 3), ("frames_per_step", 1)):
            if type(getattr(self, name)) is not int or getattr(self, name) < least:
                raise InputError(f"{name} must be at least {least}, not {getattr(self, name)}")


def frame_dataset(
    dataset: Dataset,
    scan: Scan,
    config: ReadoutConfig,
    frames: FrameSteps,
    start_rows: Sequence[float] = (0.0,),
    progress: Tick | None = None,
) -> ScanData:
    """Return the frames of the same scans in full scales, float32; ``config`` gives the array only."""
    sampled = ReadoutConfig(
        rows=config.rows, columns=config.columns, sample_bits=frames.bits, resolution=1, sample_rate_hz=frames.rate_hz
    )
    scans, images = [], []
    for number, texture in enumerate(dataset):
        for start_row in start_rows:
            codes, _ = scan.samples(sampled, texture.load(), start_row)
            steps = len(codes) // frames.frames_per_step
            if not steps:
                raise InputError(f"image {texture.name} gives {len(codes)} frames, less than one step of them")
            whole = codes[: steps * frames.frames_per_step].reshape(steps, -1)
            scans.append(whole.astype(np.float32) / sampled.full_scale)
            images.append(number)
            if progress is not None:
                progress()
    values = np.zeros((len(scans), max(map(len, scans)), scans[0].shape[1]), np.float32)
    for place, values_of_scan in zip(values, scans, strict=True):
        place[: len(values_of_scan)] = values_of_scan
    return ScanData(
        values=values,
        labels=dataset.labels[images],
        images=np.array(images, np.int64),
        names=tuple(texture.name for texture in dataset),
        class_names=dataset.class_names,
        taxels=config.taxels,
        step_s=frames.frames_per_step / frames.rate_hz,
        rate_hz=frames.rate_hz * config.taxels,
    )
