"""Convert texture scans to frames: samples, differences or level crossings."""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.skin.recordings.event_files import signals_of
from eskin.skin.textures.dataset import Dataset, Texture
from eskin.skin.textures.presets import Scan
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.frame_steps import FrameSteps
from eskin.snn.data.recordings import own_readout
from eskin.snn.data.scans import ScanData, filled, load_recordings


def frame_dataset(
    dataset: Dataset,
    scan: Scan,
    config: ReadoutConfig,
    frames: FrameSteps,
    start_rows: Sequence[float] = (0.0,),
    progress: Callable[[], object] | None = None,
) -> ScanData:
    """Return the frames of the scans of a dataset; only the array size of ``config`` is used."""
    scans, images = [], []
    for number, texture in enumerate(dataset):
        image = texture.load()
        for start_row in start_rows:
            codes = codes_of(frames, image, scan, config, start_row)
            if len(codes) < frames.frames_per_step:
                raise InputError(f"image {texture.name} gives {len(codes)} frames, but one step needs more")
            scans.append(values_of(frames, codes))
            images.append(number)
            if progress is not None:
                progress()
    return frame_data(frames, dataset, scans, images, dataset.class_names, config.taxels)


def frame_data(
    frames: FrameSteps,
    textures: Sequence[Texture],
    scans: Sequence[NDArray[Any]],
    images: Sequence[int],
    class_names: tuple[str, ...],
    taxels: int,
) -> ScanData:
    """Return scans of frames; ``images`` has the index of the texture of every scan."""
    return ScanData(
        values=filled(scans),
        labels=np.array([textures[image].label for image in images], np.int64),
        images=np.array(images, np.int64),
        names=tuple(texture.name for texture in textures),
        class_names=class_names,
        taxels=taxels,
        step_s=frames.step_s,
        rate_hz=frames.rate_hz * taxels,
    )


def frames_of_recordings(folder: Path, frames: FrameSteps) -> ScanData:
    """Return the frames of a user's recordings, made from the samples beside their event files.

    Frame k is the newest sample at k / rate, as a converter that samples and holds gives it.

    Raise InputError if the folder has no samples, the frames are faster than the samples or have more bits, or a
    recording is shorter than a step.
    """
    codes, sample_rate_hz = signals_of(folder)
    events, own = load_recordings(folder, BinConfig(bin_s=frames.step_s)), own_readout(folder)
    assert own is not None, "recordings with samples are a user's"
    bits = own.config.sample_bits
    if frames.rate_hz > 1.01 * sample_rate_hz or frames.bits > bits:
        raise InputError(
            f"{frames.name} has more samples or bits than these recordings, {sample_rate_hz:g} samples/s of {bits} "
            f"bits; choose slower or coarser frames"
        )
    scans = []
    for image in events.images:
        samples, name = codes[events.names[image]] >> (bits - frames.bits), events.names[image]
        number = int(len(samples) / sample_rate_hz * frames.rate_hz + 1e-6)
        ticks = (np.arange(number) * (sample_rate_hz / frames.rate_hz) + 1e-6).astype(int)
        if number < frames.frames_per_step:
            raise InputError(f"{name} is shorter than one step of {frames.step_s:g} s; choose faster frames")
        scans.append(values_of(frames, samples[np.minimum(ticks, len(samples) - 1)]))
    lengths = np.array([len(scan) for scan in scans], np.int64)
    rate_hz = frames.rate_hz * events.taxels
    return dataclasses.replace(events, values=filled(scans), lengths=lengths, rate_hz=rate_hz)


def codes_of(
    frames: FrameSteps, image: NDArray[np.uint8], scan: Scan, config: ReadoutConfig, start_row: float = 0.0
) -> NDArray[np.int32]:
    """Return the frames of one scan as codes, shape (frames, taxels); only the array size of ``config`` is used."""
    codes, _ = scan.samples(sampled_config(frames, config), image, start_row)
    return codes


def sampled_config(frames: FrameSteps, config: ReadoutConfig) -> ReadoutConfig:
    """Return a configuration with one sample per frame; only the array size of ``config`` is used."""
    return ReadoutConfig(
        rows=config.rows,
        columns=config.columns,
        sample_bits=frames.bits,
        resolution=1,
        sample_rate_hz=frames.rate_hz,
    )


def values_of(frames: FrameSteps, codes: NDArray[np.int32]) -> NDArray[Any]:
    """Return the network input for the frames of one scan, shape (steps, channels): float32 of samples, else int32.

    Frames that do not fill a step are left out.

    - ``codes``: signed, with a full scale of 2**(bits - 1). Shape (frames, taxels).
    """
    steps = len(codes) // frames.frames_per_step
    full_scale = 2 ** (frames.bits - 1)
    made: NDArray[Any] = codes.astype(np.float32) / np.float32(full_scale)
    if frames.kind == "frame-diff":
        made = np.diff(codes, axis=0, prepend=codes[:1])
    elif frames.kind == "frame-onoff":
        made = level_crossings(codes, full_scale >> frames.level_bits)
    made = made[: steps * frames.frames_per_step].reshape(steps, frames.frames_per_step, -1)
    return made.sum(1, dtype=np.int32) if frames.kind == "frame-onoff" else made.reshape(steps, -1)


def level_crossings(codes: NDArray[np.int32], lsb: int) -> NDArray[np.int32]:
    """Return the levels crossed up and down by each taxel per frame, shape (frames, 2 * taxels).

    A reference starts at the first code and moves one level per count, so a remainder below one level is preserved.
    """
    counts = np.zeros((len(codes), 2, codes.shape[1]), np.int32)
    reference = codes[0].copy()
    for count, code in zip(counts, codes, strict=True):
        levels = np.sign(code - reference) * (np.abs(code - reference) // lsb)
        reference += levels * lsb
        count[0], count[1] = np.maximum(levels, 0), np.maximum(-levels, 0)
    return counts.reshape(len(codes), -1)
