"""Sets of scans as tensors, made from event files or recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.events.recording import Recording
from eskin.snn.data.bins import BinConfig, bin_recording, counted_from
from eskin.snn.data.recordings import class_of, event_files, image_of, read_recordings

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True, eq=False)
class ScanData:
    """Scans with their classes, in the order of the images."""

    values: NDArray[Any]
    """Event counts (int16), or frames in full scales (float32). Shape (scans, steps, channels)."""
    labels: NDArray[np.int64]
    """Indices into ``class_names``. Shape (scans,)."""
    images: NDArray[np.int64]
    """Indices into ``names``; an image has one scan per start row. Shape (scans,)."""
    names: tuple[str, ...]
    class_names: tuple[str, ...]
    taxels: int
    """Channel c belongs to taxel c % taxels."""
    step_s: float
    """Seconds per step."""
    rate_hz: float
    """Mean population event rate of the scans over their whole length, or values per second of frames."""
    source: str = ""
    """Origin of the scans, for the user; without effect on results."""
    groups: tuple[str, ...] = ()
    """Group of each image; images of a group are in one fold. Empty: each image is a group."""
    lengths: NDArray[np.int64] | None = None
    """Steps of each scan; later steps are zero. None: all scans have all steps. Shape (scans,), or None."""

    def __len__(self) -> int:
        return len(self.values)

    def __repr__(self) -> str:
        shape = f"{len(self)} scans, {self.steps} steps of {self.step_s:g} s, {self.channels} channels"
        return f"{type(self).__name__}({shape}, classes {', '.join(self.class_names)})"

    @property
    def steps(self) -> int:
        """Time steps per scan."""
        return int(self.values.shape[1])

    @property
    def channels(self) -> int:
        """Input channels of the network."""
        return int(self.values.shape[2])

    @property
    def frames(self) -> bool:
        """True if the values are frames instead of event counts."""
        return self.values.dtype.kind == "f"

    @property
    def image_labels(self) -> NDArray[np.int64]:
        """Class index of every image, shape (len(names),)."""
        labels = np.zeros(len(self.names), np.int64)
        labels[self.images] = self.labels
        return labels

    @property
    def of_one_length(self) -> bool:
        """True if all scans have the full length."""
        return self.lengths is None or bool((self.lengths >= self.steps).all())

    def steps_of(self, scan: int) -> int:
        """Return the length of a scan in steps, without padding."""
        return self.steps if self.lengths is None else min(int(self.lengths[scan]), self.steps)

    def scans_of(self, images: Sequence[int] | NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the indices of all scans of given images, in rising order."""
        return np.flatnonzero(np.isin(self.images, images))

    def first_scans(self, images: Sequence[int] | NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the first scan of every given image."""
        numbers, first = np.unique(self.images, return_index=True)
        return first[np.searchsorted(numbers, images)]

    def batch(self, scans: Sequence[int] | NDArray[np.int64]) -> Tensor:
        """Return scans as a dense float32 tensor of shape (steps, scans, channels)."""
        import torch

        return torch.from_numpy(np.ascontiguousarray(self.values[scans].transpose(1, 0, 2), np.float32))

    def windows(self, scans: Sequence[int] | NDArray[np.int64], steps: int, generator: np.random.Generator) -> Tensor:
        """Return a random time window of each scan, shape (steps, scans, channels).

        A scan with fewer steps is filled up with zeros.
        """
        import torch

        found = np.zeros((steps, len(scans), self.channels), np.float32)
        for column, scan in enumerate(scans):
            begin = int(generator.integers(0, max(self.steps_of(scan) - steps, 0) + 1))
            window = self.values[scan, begin : min(begin + steps, self.steps_of(scan))]
            found[: len(window), column] = window
        return torch.from_numpy(found)


@dataclass(frozen=True, eq=False)
class Split:
    """Training images and held-out images of a set of scans."""

    data: ScanData
    learned: Sequence[int] | NDArray[np.int64]
    """Training images; all their scans are used."""
    held_out: Sequence[int] | NDArray[np.int64] | None = None
    """Images for the accuracy after every epoch; may be empty."""
    test: Sequence[int] | NDArray[np.int64] | None = None
    """Images whose predictions are stored for the epoch selected by ``held_out``; they select nothing."""


def load_recordings(folder: Path, bins: BinConfig, class_names: Sequence[str] | None = None) -> ScanData:
    """Return the event counts of the event files in a folder, at any depth, ordered by name.

    Raise InputError if there is no file, a file is damaged or empty, has no class or an unknown class, or the files
    come from different readouts.

    ``class_names``: classes in the order of the labels; by default those that occur, in alphabetical order. The class
    of a file is in its metadata, else it is the name of its folder.
    """
    if not folder.is_dir():
        raise InputError(f"event folder {folder} does not exist; make one with eskin replay")
    files = event_files([folder])
    recordings = read_recordings(files)
    for file, recording in zip(files, recordings, strict=True):
        if class_of(recording) is None:
            raise InputError(
                f"{file.path} has no class; put it into a folder of its class, or give its metadata the key 'class'"
            )
    return collect(recordings, bins, class_names)


def collect(recordings: Sequence[Recording], bins: BinConfig, class_names: Sequence[str] | None = None) -> ScanData:
    """Return the event counts of recordings that have name, class and start row in their metadata.

    Recordings with equal dataset, class and name are scans of one image. Shorter ones are extended by steps without
    events.
    """
    first = recordings[0].config
    found = [str(recording.metadata["class"]) for recording in recordings]
    classes = tuple(sorted(set(found)) if class_names is None else class_names)
    names = [str(recording.metadata.get("name", number)) for number, recording in enumerate(recordings)]
    for name, class_name, recording in zip(names, found, recordings, strict=True):
        if class_name not in classes:
            raise InputError(f"{name} has the unknown class {class_name!r}; known classes are {', '.join(classes)}")
        if recording.config.taxels != first.taxels:
            raise InputError(
                f"{name} has {recording.config.taxels} taxels, {names[0]} has {first.taxels}; "
                f"train on recordings of one array"
            )
        if recording.config != first:
            raise InputError(f"{name} has another readout configuration than {names[0]}; keep them apart")
    counts = [bin_recording(recording, bins) for recording in recordings]
    rates_hz = [  # as in the paper: counted events divided by the duration of the whole recording
        np.count_nonzero(recording.events["t"] >= counted_from(recording, bins.start_s)) / recording.duration_s
        for recording in recordings
    ]
    images = [image_of(recording) for recording in recordings]
    number = {image: index for index, image in enumerate(dict.fromkeys(images))}
    group_of = {image: recording.metadata.get("group") for image, recording in zip(images, recordings, strict=True)}
    return ScanData(
        values=filled(counts),
        labels=np.array([classes.index(name) for name in found], np.int64),
        images=np.array([number[image] for image in images], np.int64),
        names=_names_of(list(number)),
        class_names=classes,
        taxels=first.taxels,
        step_s=bins.bin_s,
        rate_hz=float(np.mean(rates_hz)),
        lengths=np.array([len(one) for one in counts], np.int64),
        groups=tuple(map(str, group_of.values())) if all(group_of.values()) else (),
    )


def filled(scans: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Return scans as one array, shape (scans, steps, channels), with shorter scans padded with 0."""
    values = np.zeros((len(scans), max(map(len, scans)), scans[0].shape[1]), scans[0].dtype)
    for place, scan in zip(values, scans, strict=True):
        place[: len(scan)] = scan
    return values


def _names_of(images: list[tuple[str, str, str]]) -> tuple[str, ...]:
    """Return distinct names of images, prefixed with class and dataset if necessary."""
    for parts in (slice(2, 3), slice(1, 3), slice(0, 3)):
        names = ["/".join(image[parts]) for image in images]
        if len(set(names)) == len(names):
            break
    return tuple(names)
