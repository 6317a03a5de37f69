"""Event files in, event counts per time bin out, as the tensors that the networks take (docs/classifier.md).

Recordings of the RTL and of the model (``snn.scans``) pass through the same ``collect``, so equal events give equal
tensors.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.config import ReadoutConfig
from model.errors import InputError
from model.events.address import Events
from model.events.recording import Recording
from model.textures.presets import preset

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True, kw_only=True)
class BinConfig:
    """How events become counts per time step.

    Parameters
    ----------
    bin_s : float
        Length of a time bin in seconds; 10 ms in the authors' later work on their chip, open in the paper.
    start_s, stop_s : float or None
        Time window. By default from the first event that counts in the preset of the recording (10 ms for
        LCS in ``paper``, 0 in ``physical``) to the end. A last bin that the window does not fill is left out.
    polarity : bool
        ON and OFF events of a taxel are two channels; else they are counted together.
    """

    bin_s: float = 0.004
    start_s: float | None = None
    stop_s: float | None = None
    polarity: bool = True

    def __post_init__(self) -> None:
        if not (math.isfinite(self.bin_s) and self.bin_s > 0):
            raise InputError(f"bin_s must be a positive number of seconds, not {self.bin_s!r}")
        for name in ("start_s", "stop_s"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value >= 0):
                raise InputError(f"{name} must be a number of seconds from 0, not {value!r}")
        if self.start_s is not None and self.stop_s is not None and self.stop_s <= self.start_s:
            raise InputError(f"stop_s must be later than start_s, not {self.stop_s:g} after {self.start_s:g}")

    def channels(self, config: ReadoutConfig) -> int:
        """Return the channels of a readout: taxels, twice where ON and OFF are kept apart."""
        return config.taxels * (2 if self.polarity and config.has_polarity else 1)

    def channel_of(self, events: Events, config: ReadoutConfig) -> NDArray[np.int64]:
        """Return the channel of every event: row * columns + column, plus the number of taxels for OFF apart."""
        channel = events["y"].astype(np.int64) * config.columns + events["x"]
        return channel + np.where(events["p"], 0, self.channels(config) - config.taxels)


class SparseCounts(NamedTuple):
    """Event counts of one recording, without the zeros.

    Attributes
    ----------
    step, channel : int64 arrays, shape (entries,)
        In rising order of step, then channel. Channel = taxel index, plus the number of taxels for OFF.
    number : int64 array, shape (entries,)
        Events in that bin.
    shape : (int, int)
        Steps and channels.
    """

    step: NDArray[np.int64]
    channel: NDArray[np.int64]
    number: NDArray[np.int64]
    shape: tuple[int, int]

    def dense(self) -> NDArray[np.int64]:
        """Return the counts with the zeros, shape (steps, channels)."""
        full = np.zeros(self.shape, np.int64)
        full[self.step, self.channel] = self.number
        return full


def bin_recording(recording: Recording, bins: BinConfig) -> SparseCounts:
    """Return the event counts of a recording; an event belongs to the bin in which it left the readout.

    Raises
    ------
    InputError
        If the window holds no event or not one whole bin.
    """
    config, events = recording.config, recording.events
    name = recording.metadata.get("name", "the recording")
    start = _counted_from(recording) if bins.start_s is None else round(bins.start_s * config.clock_hz)
    stop = recording.duration_clocks
    if bins.stop_s is not None:
        stop = min(stop, round(bins.stop_s * config.clock_hz))
    width = bins.bin_s * config.clock_hz
    steps = math.floor((stop - start) / width + 1e-9)
    if steps < 1:
        raise InputError(
            f"{name} lasts {recording.duration_s:.6g} s and leaves no whole bin of {bins.bin_s:g} s in the time "
            f"window; choose a shorter bin or another window"
        )
    step = np.floor((events["t"] - start) / width).astype(np.int64)
    seen = (events["t"] >= start) & (step < steps)
    if not seen.any():
        raise InputError(f"{name} has no event in the time window; record it again or choose another window")
    channels = bins.channels(config)
    channel = bins.channel_of(events, config)
    place, count = np.unique(step[seen] * channels + channel[seen], return_counts=True)
    return SparseCounts(place // channels, place % channels, count, (steps, channels))


def _counted_from(recording: Recording) -> int:
    """Return the clock of the first sample tick whose events count in the recording's preset."""
    name = recording.metadata.get("preset")
    if not isinstance(name, str):
        return 0
    return preset(name).skipped_ticks(recording.config) * recording.config.clocks_per_sample


# -- a set of scans ----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class ScanData:
    """Scans with their classes, in the order of the images.

    Attributes
    ----------
    values : array, shape (scans, steps, channels)
        Event counts (int16), or frames in full scales (float32).
    labels : int64 array, shape (scans,)
        Indices into ``class_names``.
    images : int64 array, shape (scans,)
        Indices into ``names``; an image has one scan per start row.
    names, class_names : tuple of str
    taxels : int
        Channel c belongs to taxel c % taxels.
    step_s : float
        Seconds per step.
    rate_hz : float
        Mean population event rate of the scans over their whole length; of frames, values per second.
    """

    values: NDArray[Any]
    labels: NDArray[np.int64]
    images: NDArray[np.int64]
    names: tuple[str, ...]
    class_names: tuple[str, ...]
    taxels: int
    step_s: float
    rate_hz: float

    def __len__(self) -> int:
        return len(self.values)

    @property
    def steps(self) -> int:
        """Time steps of a scan."""
        return int(self.values.shape[1])

    @property
    def channels(self) -> int:
        """Inputs of the network."""
        return int(self.values.shape[2])

    @property
    def frames(self) -> bool:
        """Whether the values are those of frames and not counts."""
        return self.values.dtype.kind == "f"

    @property
    def image_labels(self) -> NDArray[np.int64]:
        """Label of every image, shape (len(names),)."""
        labels = np.zeros(len(self.names), np.int64)
        labels[self.images] = self.labels
        return labels

    def scans_of(self, images: Sequence[int] | NDArray[np.int64], first_row_only: bool = False) -> NDArray[np.int64]:
        """Return the scans of some images, by default those of all start rows, in rising order."""
        chosen = np.flatnonzero(np.isin(self.images, images))
        if not first_row_only:
            return chosen
        return chosen[np.unique(self.images[chosen], return_index=True)[1]]

    def batch(self, scans: Sequence[int] | NDArray[np.int64]) -> Tensor:
        """Return some scans as a dense float32 tensor, time first: shape (steps, scans, channels)."""
        import torch

        return torch.from_numpy(np.ascontiguousarray(self.values[scans].transpose(1, 0, 2), np.float32))

    def sparse_batch(self, scans: Sequence[int] | NDArray[np.int64]) -> Tensor:
        """Return the same tensor in torch's coordinate format: indices (step, scan, channel), events only."""
        return self.batch(scans).to_sparse()


def load_recordings(
    paths: Path | Iterable[Path], bins: BinConfig, class_names: Sequence[str] | None = None
) -> ScanData:
    """Return the event counts of event files, as a replay leaves them.

    Parameters
    ----------
    paths : Path or iterable of Path
        Event files, or a folder that holds them at any depth, taken in the order of their names.
    bins : BinConfig
    class_names : sequence of str, optional
        Classes in the order of the labels; by default those that occur, in alphabetical order.

    Raises
    ------
    InputError
        If there is no file, a file is damaged or empty, has no class or an unknown one, or the files come
        from different readouts.
    """
    if isinstance(paths, Path):
        folder = paths
        if not folder.is_dir():
            raise InputError(f"event folder {folder} does not exist; make one with python -m cocotb_tests replay")
        paths = event_files(folder)
    pairs = [(path, Recording.load(path)) for path in paths]
    if not pairs:
        raise InputError("the list of event files is empty; give at least one")
    for path, recording in pairs:
        if not isinstance(recording.metadata.get("class"), str):
            raise InputError(f"{path} does not say its class; its metadata need the key 'class'")
    return collect([recording for _, recording in pairs], bins, class_names)


def event_files(folder: Path) -> list[Path]:
    """Return the event files of a folder, at any depth, in the order of their names; refuse one without any."""
    found = sorted(folder.rglob("*.npz"))
    if not found:
        raise InputError(
            f"event folder {folder} holds no event files (.npz); record some with python -m cocotb_tests replay"
        )
    return found


def collect(recordings: Sequence[Recording], bins: BinConfig, class_names: Sequence[str] | None = None) -> ScanData:
    """Return the event counts of recordings whose metadata give name, class and start row.

    Recordings of equal name are scans of one image. Shorter ones are filled up with steps without events.
    """
    first = recordings[0].config
    found = [str(recording.metadata["class"]) for recording in recordings]
    classes = tuple(sorted(set(found)) if class_names is None else class_names)
    names = [str(recording.metadata.get("name", number)) for number, recording in enumerate(recordings)]
    for name, class_name, recording in zip(names, found, recordings, strict=True):
        if class_name not in classes:
            raise InputError(f"{name} is of unknown class {class_name!r}; known are {', '.join(classes)}")
        if recording.config.taxels != first.taxels:
            raise InputError(
                f"{name} has {recording.config.taxels} taxels, {names[0]} has {first.taxels}; "
                f"train on recordings of one array"
            )
        if recording.config != first:
            raise InputError(f"{name} comes from another readout configuration than {names[0]}; keep them apart")
    sparse = [bin_recording(recording, bins) for recording in recordings]
    steps = max(counts.shape[0] for counts in sparse)
    values = np.zeros((len(sparse), steps, bins.channels(first)), np.int16)
    for scan, counts in zip(values, sparse, strict=True):
        if counts.number.max() > np.iinfo(np.int16).max:
            raise InputError(f"a time bin of {bins.bin_s:g} s holds {counts.number.max()} events; choose a shorter one")
        scan[counts.step, counts.channel] = counts.number
    unique = tuple(dict.fromkeys(names))
    number = {name: index for index, name in enumerate(unique)}
    return ScanData(
        values=values,
        labels=np.array([classes.index(name) for name in found], np.int64),
        images=np.array([number[name] for name in names], np.int64),
        names=unique,
        class_names=classes,
        taxels=first.taxels,
        step_s=bins.bin_s,
        rate_hz=float(np.mean([counted_rate_hz(recording) for recording in recordings])),
    )


def counted_rate_hz(recording: Recording) -> float:
    """Return the population event rate as published rates are: counted events over the whole observation."""
    counted = int(np.count_nonzero(recording.events["t"] >= _counted_from(recording)))
    return counted / recording.duration_s


# -- augmentation ------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class AugmentConfig:
    """What is changed at random in every training scan, each time anew.

    Start rows are not drawn here: they are scans of their own (``record_dataset``).

    Parameters
    ----------
    shift_steps : int
        The scan moves by -shift_steps..shift_steps steps. What leaves is lost; the steps that enter have no events, or
        repeat the frame at the edge.
    speed_spread : float
        The scan runs 1 - speed_spread .. 1 + speed_spread times as fast: its events move in time, and none is split
        or made up (``at_speed``).
    drop_taxels : float
        Probability with which a taxel is silent for the whole scan.
    """

    shift_steps: int = 0
    speed_spread: float = 0.0
    drop_taxels: float = 0.0

    def __post_init__(self) -> None:
        if self.shift_steps < 0:
            raise InputError(f"shift_steps must be at least 0, not {self.shift_steps}")
        if not 0 <= self.speed_spread < 1:
            raise InputError(f"speed_spread must be from 0 to below 1, not {self.speed_spread!r}")
        if not 0 <= self.drop_taxels < 1:
            raise InputError(f"drop_taxels must be a probability below 1, not {self.drop_taxels!r}")


def augment(
    batch: Tensor, taxels: int, config: AugmentConfig, generator: np.random.Generator, frames: bool = False
) -> Tensor:
    """Return a changed copy of a batch, shape (steps, scans, channels); the same numbers for the same generator."""
    import torch

    steps, scans, channels = batch.shape
    if config.speed_spread:
        spread = config.speed_spread
        batch = at_speed(batch, torch.from_numpy(generator.uniform(1 - spread, 1 + spread, scans)).to(batch))
    if config.shift_steps:
        shifts = generator.integers(-config.shift_steps, config.shift_steps + 1, scans)
        source = torch.arange(steps)[:, None] - torch.from_numpy(shifts)[None, :]
        outside = (source < 0) | (source >= steps)
        batch = batch[source.clamp(0, steps - 1), torch.arange(scans)]
        if not frames:
            batch[outside] = 0.0
    if config.drop_taxels:
        kept = torch.from_numpy(generator.random((scans, taxels)) >= config.drop_taxels).to(batch)
        batch = batch * kept.repeat(1, channels // taxels)
    return batch


def at_speed(batch: Tensor, speed: Tensor) -> Tensor:
    """Return the counts of scans at other speeds, shape (steps, scans, channels).

    Event k of the n in a bin stands at (k - 1/2) / n of it. Bin t of a scan at speed v holds the events between v t
    and v (t + 1) bins of the original; what comes after the last bin is lost, and a faster scan ends early. Plain level
    crossing would send these events at that speed; a leak or a closing window, which have their own pace, others.

    Parameters
    ----------
    batch : shape (steps, scans, channels)
        Whole numbers.
    speed : shape (scans,)
        Positive; 1 leaves a scan as it is.
    """
    import torch

    steps = len(batch)
    until = torch.cat((batch.new_zeros(1, *batch.shape[1:]), batch.cumsum(0)))  # events before each bin's start
    place = (torch.arange(steps + 1)[:, None] * speed[None, :]).clamp(max=steps)
    lower = place.floor().long().clamp(max=steps - 1)
    part = (place - lower)[:, :, None]
    index = lower[:, :, None].expand(-1, -1, batch.shape[2])
    below = until.gather(0, index)
    return (below + part * (until.gather(0, index + 1) - below) + 0.5).floor().diff(dim=0)
