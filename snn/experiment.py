"""What a training run consists of: textures, readout, time steps, network and training, as one JSON-able object."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.config import ReadoutConfig
from model.dataset import open_dataset
from model.errors import InputError
from model.rates import PAPER_TAU_S
from model.texture import PhysicalScan, preset
from snn.dataset import BinConfig, ScanData, load_recordings
from snn.network import NetworkConfig
from snn.scans import FrameConfig, Progress, frame_dataset, record_dataset
from snn.train import TrainConfig


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """All that fixes a result, but folds and seeds.

    Parameters
    ----------
    dataset : str or None
        As ``model.dataset.open_dataset`` takes it.
    events : str or None
        Folder of event files (an RTL replay) instead of the model.
    preset : "physical" or "paper"
    readout : ReadoutConfig
        Before the preset sets its fields.
    tau_s : float or None
        N-LCS: time constant in seconds.
    frames : FrameConfig or None
        Frames instead of events.
    start_rows : int
        Scans of each image, evenly spread over it; tests take the first.
    bins : BinConfig
    network : dict
        Fields of NetworkConfig but inputs and classes, which follow from the data.
    train : TrainConfig
    """

    dataset: str | None = None
    events: str | None = None
    preset: str = "physical"
    readout: ReadoutConfig = field(default_factory=lambda: ReadoutConfig(resolution=4))
    tau_s: float | None = None
    frames: FrameConfig | None = None
    start_rows: int = 1
    bins: BinConfig = field(default_factory=BinConfig)
    network: dict[str, Any] = field(default_factory=dict)
    train: TrainConfig = field(default_factory=TrainConfig)

    def __post_init__(self) -> None:
        known = {f.name for f in dataclasses.fields(NetworkConfig)} - {"inputs", "classes"}
        if unknown := sorted(set(self.network) - known):
            raise InputError(f"unknown network field {unknown[0]!r}; known are {', '.join(sorted(known))}")
        if self.events is not None and self.frames is not None:
            raise InputError("frames are made from textures, not from event files; give one of the two")
        if self.frames is not None and self.train.speed_spread:
            raise InputError("speed_spread moves events in time and cannot be used for frames; set it to 0")
        NetworkConfig(inputs=1, classes=1, **self.network)

    def data(self, progress: Progress | None = None) -> ScanData:
        """Return the scans; the model's take a few hundredths of a second each."""
        if self.events is not None:
            return load_recordings(Path(self.events), self.bins)
        textures, scan = open_dataset(self.dataset), preset(self.preset)
        tau_s = (self.tau_s or PAPER_TAU_S) if self.readout.encoding == "nlcs" else None
        config = scan.configure(self.readout, tau_s)
        rows = [0.0]
        if self.start_rows != 1:
            if not isinstance(scan, PhysicalScan):
                raise InputError("the paper preset has one start row; use the physical preset for more")
            rows = scan.start_rows(config, textures[0].load().shape, self.start_rows)
        if self.frames is not None:
            return frame_dataset(textures, scan, config, self.frames, rows, progress)
        return record_dataset(textures, scan, config, self.bins, rows, progress)

    def network_config(self, data: ScanData) -> NetworkConfig:
        """Return the network for these scans."""
        return NetworkConfig(inputs=data.channels, classes=len(data.class_names), **self.network)

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values."""
        return dataclasses.asdict(self)


def stratified_folds(labels: NDArray[np.int64], folds: int, seed: int = 0) -> list[NDArray[np.int64]]:
    """Return the test images of each fold: every image once, every class spread evenly.

    A class whose images do not divide by the folds gives its spare ones to the folds that have fewest.

    Parameters
    ----------
    labels : shape (images,)
    folds, seed : int
        The same seed gives the same folds.
    """
    counts = np.bincount(labels)
    fewest = int(counts[counts > 0].min())
    if not 2 <= folds <= fewest:
        raise InputError(f"the number of folds must be in 2..{fewest}, the images of the smallest class, not {folds}")
    generator = np.random.default_rng([seed, folds])
    fold_of = np.empty(len(labels), np.int64)
    following = 0
    for label in range(len(counts)):
        images = generator.permutation(np.flatnonzero(labels == label))
        fold_of[images] = (following + np.arange(len(images))) % folds
        following += len(images)
    return [np.flatnonzero(fold_of == fold) for fold in range(folds)]
