"""Convert recordings to NIRData, the event format of NIR (docs/guide/exchange.md)."""

import io
import json
import math
from pathlib import Path
from typing import Any

import h5py  # type: ignore[import-untyped]
import nir
import numpy as np

from eskin.base.errors import InputError
from eskin.base.files import atomic_write
from eskin.model.address_events import EVENT_DTYPE
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import MAX_CLOCKS, Recording
from eskin.snn.data.bins import BinConfig, bin_recording
from eskin.snn.exchange.hdf5 import read_hdf5
from eskin.snn.exchange.nir_layers import INPUT

OBSERVABLE = "spikes"
HEADER = "recording"
"""Dataset beside the data of a NIRData file: the configuration, duration and metadata of the recording as JSON."""


def to_nir_data(recording: Recording) -> nir.NIRGraphData:
    """Return the events of a recording as NIRData.

    Indices are channels, row * columns + column, plus the number of taxels for OFF; times are in seconds, in the
    order of the recording.

    Raise InputError if the recording lasts longer than 2**51 clocks.
    """
    if recording.duration_clocks > MAX_CLOCKS:
        raise InputError(f"the recording has {recording.duration_clocks} clocks, more than 2**51; split it")
    config, events = recording.config, recording.events
    if not math.isfinite(recording.duration_s):
        raise InputError(f"at a clock of {config.clock_hz:g} Hz the recording has no length in seconds")
    bins = BinConfig()
    data = nir.EventData(
        idx=bins.channel_of(events, config)[None],
        time=(events["t"] / config.clock_hz)[None],
        n_neurons=bins.channels(config),
        t_max=recording.duration_s,
    )
    return nir.NIRGraphData({INPUT: nir.NIRNodeData({OBSERVABLE: data})})


def to_nir_grid(recording: Recording, bins: BinConfig) -> nir.NIRGraphData:
    """Return the event counts per time bin of a recording as NIRData (float32)."""
    counts = bin_recording(recording, bins).astype(np.float32)
    return nir.NIRGraphData({INPUT: nir.NIRNodeData({OBSERVABLE: nir.TimeGriddedData(counts[None], bins.bin_s)})})


def from_nir_data(data: nir.NIRGraphData, config: ReadoutConfig, metadata: dict[str, Any] | None = None) -> Recording:
    """Return the recording for NIRData, the inverse of ``to_nir_data``.

    Raise InputError if there are no such events, or events do not fit the readout.

    - ``data``: entries with the index -1 are no events.
    - ``config``: the readout; NIRData does not carry it.
    """
    node = data.nodes.get(INPUT)
    events = node.observables.get(OBSERVABLE) if isinstance(node, nir.NIRNodeData) else None
    if events is None or type(events) is not nir.EventData:
        found = "nothing" if events is None else type(events).__name__
        raise InputError(f"node {INPUT!r} must have the observable {OBSERVABLE!r} of type EventData, not {found}")
    if events.n_samples != 1:
        raise InputError(f"the data contain {events.n_samples} recordings; convert them one by one")
    channels = BinConfig().channels(config)
    if events.n_neurons != channels:
        raise InputError(
            f"the data have {events.n_neurons} channels, but the readout has {channels}; give its configuration"
        )
    real = events.idx[0] != -1
    channel, time_s = events.idx[0][real], events.time[0][real]
    if wrong := np.flatnonzero((channel < 0) | (channel >= channels) | ~np.isfinite(time_s)).tolist():
        at = wrong[0]
        raise InputError(
            f"event {at} has channel {channel[at]} at {time_s[at]} s; channels must be in 0..{channels - 1}, and times "
            f"finite"
        )
    if not 0 <= events.t_max < math.inf:
        raise InputError(f"the data last {events.t_max} s; a duration must be a finite number of seconds from 0")
    if events.t_max * config.clock_hz > MAX_CLOCKS:
        raise InputError(
            f"the data last {events.t_max} s at {config.clock_hz:g} Hz, more than 2**51 clocks; split them"
        )
    duration = round(events.t_max * config.clock_hz)
    made = np.empty(len(channel), EVENT_DTYPE)
    made["t"] = np.rint(time_s * config.clock_hz)
    made["y"], made["x"] = np.divmod(channel % config.taxels, config.columns)
    made["p"] = channel < config.taxels
    return Recording(made, config, duration, metadata=metadata or {})


def load_recording(path: Path) -> Recording:
    """Return the recording from an event file (.npz) or a NIRData file (.nir)."""
    if path.suffix == ".npz":
        return Recording.load(path)
    if path.suffix == ".nir":
        return load_nir_data(path)
    raise InputError(f"{path} has an unknown format; give events as .npz, .nir, .aedat4, or as a table")


def save_nir_data(path: Path, recording: Recording, bins: BinConfig | None = None) -> None:
    """Write a recording as a NIRData file (HDF5): events, or counts if ``bins`` is given.

    The configuration and the metadata stand beside the data, where ``nir.read_data`` does not look.
    """
    if path.suffix != ".nir":
        raise InputError(f"NIR files end in .nir, but {path.name} does not; rename the output")
    header = {
        "config": recording.config.to_dict(),
        "version": recording.version,
        "metadata": recording.metadata,
    }
    try:
        text = json.dumps(header, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"the metadata of a recording must be plain JSON values: {error}") from None
    data = io.BytesIO()
    nir.write_data(data, to_nir_data(recording) if bins is None else to_nir_grid(recording, bins))
    with h5py.File(data, "a") as file:
        file[HEADER] = text
    with atomic_write(path) as out:
        out.write(data.getvalue())


def load_nir_data(path: Path) -> Recording:
    """Return the recording from a NIRData file that contains events.

    Raise InputError if the file cannot be read, is damaged, or has another content.
    """
    content = read_hdf5(path, "NIRData; convert its event file again")
    try:
        data = nir.read_data(io.BytesIO(content))
        with h5py.File(io.BytesIO(content)) as file:
            header = json.loads(file[HEADER][()]) if HEADER in file else None
    except Exception:  # a damaged file makes h5py, zlib and nir raise almost any type
        raise InputError(f"{path} is damaged or not NIRData; convert its event file again") from None
    if not isinstance(header, dict) or not {"config", "version", "metadata"} <= set(header):
        raise InputError(f"{path} contains no readout; use from_nir_data with a configuration")
    try:
        found = from_nir_data(data, ReadoutConfig.from_dict(header["config"]), header["metadata"])
        return Recording(found.events, found.config, found.duration_clocks, header["version"], found.metadata)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
