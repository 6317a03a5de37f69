"""Compute statistics of every taxel's signal, the input of a baseline classifier."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.files import read_arrays, read_json, write_arrays, write_json
from eskin.skin.recordings.folder import RecordingSet

SEGMENT, BANDS = 64, 16
"""Samples of a segment of the spectrum (Welch, half overlapping, Hann), and bands into which its lines are averaged."""

_FILE = "signals.json"
_CODES = "signals.codes"
"""File of codes: an archive like ``.npz``, without the ending of event files."""

_LEAST = 1e-6
"""Small number that is added to deviations and powers before a logarithm."""


def statistics(signal: NDArray[Any]) -> NDArray[np.float64]:
    """Return mean, log deviation and log band powers of every column.

    Parameters
    ----------
    signal : shape (ticks, columns)
        A recording shorter than a segment is extended with its last sample.

    Returns
    -------
    float64 array, shape (columns * (2 + BANDS),)
    """
    from scipy.signal import welch

    signal = np.asarray(signal, np.float64)
    filled = np.pad(signal, ((0, max(SEGMENT - len(signal), 0)), (0, 0)), mode="edge")
    power = welch(filled, nperseg=SEGMENT, axis=0)[1][1:]
    bands = np.array([part.mean(0) for part in np.array_split(power, BANDS)])
    logs = np.log(np.vstack([signal.std(0)[None], np.sqrt(bands)]) + _LEAST)
    return np.concatenate([signal.mean(0), logs.ravel()])


def write_signals(recordings: RecordingSet, folder: Path) -> None:
    """Write length and statistics of the signals of every recording beside their event files."""
    full_scale = recordings.config.full_scale
    found = {
        source.name: {"ticks": len(codes), "statistics": statistics(codes / full_scale).tolist()}
        for source, codes in zip(recordings.sources, recordings.codes, strict=True)
    }
    write_json(folder / _FILE, {"sample_rate_hz": recordings.config.sample_rate_hz, "recordings": found})
    sources = zip(recordings.sources, recordings.codes, strict=True)
    named: dict[str, Any] = {source.name: codes.astype(np.int16) for source, codes in sources}
    write_arrays(folder / _CODES, named, compressed=True)


def signals_of(folder: Path) -> tuple[dict[str, NDArray[np.int32]], float]:
    """Return the codes of each recording by name, shape (ticks, taxels), and their common samples per second.

    Raises
    ------
    InputError
        If the folder has no samples, as one of event files alone, or they are damaged.
    """
    content = _read(folder)
    if content is None or not (folder / _CODES).exists():
        raise InputError("frames need samples, and event files have none; give textures or --data")
    stored = read_arrays(folder / _CODES, "the samples of recordings", "remove its folder")
    if set(stored) != set(content["recordings"]):
        raise InputError(f"{folder / _CODES} and {_FILE} name other recordings; remove their folder")
    return {name: codes.astype(np.int32) for name, codes in stored.items()}, float(content["sample_rate_hz"])


def seconds_of(folder: Path) -> NDArray[np.float64] | None:
    """Return the length in seconds of each recording in a folder of event files; None if unknown."""
    content = _read(folder)
    if content is None:
        return None
    return np.array([one["ticks"] / content["sample_rate_hz"] for one in content["recordings"].values()])


def signal_statistics(folder: Path, names: tuple[str, ...]) -> NDArray[np.float64] | None:
    """Return the signal statistics of recordings, shape (recordings, columns); None without stored statistics."""
    content = _read(folder)
    if content is None or not set(names) <= set(content["recordings"]):
        return None
    return np.array([content["recordings"][name]["statistics"] for name in names])


def _read(folder: Path) -> dict[str, Any] | None:
    path = folder / _FILE
    if not path.exists():
        return None
    content: dict[str, Any] = read_json(path, "the statistics of recordings", dict)
    if not {"sample_rate_hz", "recordings"} <= set(content):
        raise InputError(f"{path} is damaged; remove its folder")
    return content
