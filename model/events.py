"""Address events in memory and on disk (readout specification, section 5; docs/files.md)."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from model import __version__
from model.config import ReadoutConfig
from model.errors import InputError
from model.files import atomic_write

EVENT_DTYPE = np.dtype([("t", "<i8"), ("x", "<i2"), ("y", "<i2"), ("p", "?")])
"""One address event: t in clocks since the end of reset, x = column, y = row, p True = ON.

The fields are those that event tools (tonic, for one) expect. The events of a unipolar encoder have p True.
"""

Events = NDArray[Any]
"""A 1-D array of EVENT_DTYPE, in the order of the transfers: t never falls."""

FORMAT_NAME = "spiking-eskin-readout events"
FORMAT_VERSION = 1

_EVENTS_MEMBER = "events.npy"
_METADATA_MEMBER = "metadata.npy"
_HEADER_TYPES: dict[str, type] = {
    "clock_hz": float,
    "duration_clocks": int,
    "version": str,
    "config": dict,
    "metadata": dict,
}


def make_events(t: ArrayLike, row: ArrayLike, column: ArrayLike, polarity: ArrayLike = True) -> Events:
    """Return events of four columns of numbers.

    Parameters
    ----------
    t, row, column, polarity : array_like, shape (events,) or scalar
        Clock, row (y), column (x) and polarity (True = ON) of each event.

    Returns
    -------
    ndarray of EVENT_DTYPE, shape (events,)
    """
    t, row, column, polarity = np.broadcast_arrays(
        np.atleast_1d(t), np.asarray(row), np.asarray(column), np.asarray(polarity)
    )
    events = np.empty(t.shape, EVENT_DTYPE)
    events["t"], events["x"], events["y"], events["p"] = t, column, row, polarity
    return events


def no_events() -> Events:
    """Return an array of no events."""
    return np.empty(0, EVENT_DTYPE)


@dataclass(frozen=True, eq=False)
class Recording:
    """Address events with everything that is needed to read them. Immutable, validated on construction.

    Parameters
    ----------
    events : ndarray of EVENT_DTYPE, shape (events,)
        In the order of the transfers; the array is kept as a read-only copy.
    config : ReadoutConfig
        The readout that sent them.
    duration_clocks : int
        Clocks that were observed; all events lie in ``0 <= t < duration_clocks``. Rates divide by it.
    version : str
        Version of the program that recorded.
    metadata : dict, optional
        Anything else that JSON can hold: name, label, source, ...

    Raises
    ------
    InputError
        If the events do not fit the array, the encoder or the duration, or are out of order.
    """

    events: Events
    config: ReadoutConfig
    duration_clocks: int
    version: str = __version__
    metadata: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_events(self.events, self.config, self.duration_clocks)
        events = self.events.copy()
        events.setflags(write=False)
        object.__setattr__(self, "events", events)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Recording):
            return NotImplemented
        return self._header() == other._header() and np.array_equal(self.events, other.events)

    __hash__ = None  # type: ignore[assignment]

    @property
    def clock_hz(self) -> float:
        """Clock frequency in hertz, by which t becomes time; the file carries it for other readers."""
        return self.config.clock_hz

    @property
    def duration_s(self) -> float:
        """Observed time in seconds."""
        return self.duration_clocks / self.clock_hz

    @property
    def rate_hz(self) -> float:
        """Population event rate: events per second of the whole array; 0 for an empty observation."""
        return len(self.events) / self.duration_s if self.duration_clocks else 0.0

    def _header(self) -> dict[str, Any]:
        return {
            "format": FORMAT_NAME,
            "format_version": FORMAT_VERSION,
            "version": self.version,
            "clock_hz": self.clock_hz,
            "duration_clocks": self.duration_clocks,
            "config": self.config.to_dict(),
            "metadata": self.metadata,
        }

    def save(self, path: Path) -> None:
        """Write an ``.npz`` file, whole or not at all; equal recordings give equal bytes.

        Raises
        ------
        InputError
            If the name does not end in .npz, the file cannot be written, or the metadata are not JSON.
        """
        check_event_path(path)
        try:
            text = json.dumps(self._header(), allow_nan=False)
        except (TypeError, ValueError) as error:
            raise InputError(f"the metadata of a recording must be plain JSON values: {error}") from None
        with atomic_write(path) as file, zipfile.ZipFile(file, "w") as archive:
            _add(archive, _EVENTS_MEMBER, self.events)
            _add(archive, _METADATA_MEMBER, np.array(text))

    @classmethod
    def load(cls, path: Path) -> Recording:
        """Read an ``.npz`` file that :meth:`save` wrote.

        Raises
        ------
        InputError
            If the file cannot be read, is damaged, is not a recording, has another format version, or its
            events do not fit its configuration.
        """
        events, text = _read_members(path)
        try:
            return cls._from_parts(events, text)
        except InputError as error:
            raise InputError(f"{path} is not a valid event file: {error}; record it again") from None

    @classmethod
    def _from_parts(cls, events: NDArray[Any], text: str) -> Recording:
        try:
            header = json.loads(text)
        except (ValueError, RecursionError):
            raise InputError("its metadata are not JSON") from None
        if not isinstance(header, dict) or header.get("format") != FORMAT_NAME:
            raise InputError(f"its format is not {FORMAT_NAME!r}")
        if (version := header.get("format_version")) != FORMAT_VERSION:
            raise InputError(f"it has format version {version!r}, this program reads {FORMAT_VERSION}")
        for name, kind in _HEADER_TYPES.items():
            if type(header.get(name)) is not kind:
                raise InputError(f"its metadata have no usable {name}")
        config = ReadoutConfig.from_dict(header["config"])
        if header["clock_hz"] != config.clock_hz:
            raise InputError(f"its clock_hz {header['clock_hz']:g} is not that of its configuration")
        return cls(events, config, header["duration_clocks"], header["version"], header["metadata"])


def check_event_path(path: Path) -> None:
    """Refuse an output name that does not say what the file will be."""
    if path.suffix != ".npz":
        raise InputError(f"event files end in .npz, {path.name} does not; rename the output")


def check_events(events: Events, config: ReadoutConfig, duration_clocks: int) -> None:
    """Raise InputError unless events are of EVENT_DTYPE, in order, in the array and in the duration."""
    if not isinstance(events, np.ndarray) or events.dtype != EVENT_DTYPE or events.ndim != 1:
        got = f"shape {events.shape} of {events.dtype}" if isinstance(events, np.ndarray) else type(events).__name__
        raise InputError(f"events must be a one-dimensional array with the fields t, x, y, p, not {got}")
    if duration_clocks < 0:
        raise InputError(f"duration_clocks must not be negative, not {duration_clocks}")
    if not len(events):
        return
    limits = {"t": (duration_clocks, "the duration in clocks"), "x": (config.columns, "columns")}
    limits["y"] = (config.rows, "rows")
    for name, (limit, what) in limits.items():
        column = events[name]
        if wrong := np.flatnonzero((column < 0) | (column >= limit)).tolist():
            raise InputError(f"event {wrong[0]} has {name} = {column[wrong[0]]}, outside 0..{limit - 1} ({what})")
    if wrong := np.flatnonzero(np.diff(events["t"]) < 0).tolist():
        raise InputError(f"event {wrong[0] + 1} is earlier than the one before it")
    # A boolean is one byte; anything but 0 and 1 in it would print as True and compare as different.
    if wrong := np.flatnonzero(events["p"].view(np.uint8) > 1).tolist():
        raise InputError(f"event {wrong[0]} has a polarity that is neither 0 nor 1")
    if not config.has_polarity and not events["p"].all():
        raise InputError(f"event {int(np.argmin(events['p']))} is OFF, which encoding nlcs never sends")


# -- the file ----------------------------------------------------------------------------------------


def _add(archive: zipfile.ZipFile, name: str, array: NDArray[Any]) -> None:
    """Add an array to an archive, with the fixed date that makes files reproducible."""
    data = io.BytesIO()
    np.lib.format.write_array(data, array, allow_pickle=False)
    info = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
    info.compress_type = zipfile.ZIP_DEFLATED
    archive.writestr(info, data.getvalue())


def _read_members(path: Path) -> tuple[NDArray[Any], str]:
    """Return the two arrays of an event file, the events and the text of its metadata."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = set(archive.namelist())
            if names >= {_EVENTS_MEMBER, _METADATA_MEMBER}:
                events, metadata = (_read_array(archive, n) for n in (_EVENTS_MEMBER, _METADATA_MEMBER))
                if metadata.dtype.kind == "U" and metadata.ndim == 0:
                    return events, str(metadata)
    except Exception:  # a damaged archive makes zipfile, zlib and NumPy raise almost any type
        raise InputError(
            f"{path} is damaged or not an event file; record it again with python -m model encode"
        ) from None
    raise InputError(f"{path} is an archive, but not an event file; make one with python -m model encode")


def _read_array(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    """Return one member; reading it whole checks its sum before its header is believed."""
    array: NDArray[Any] = np.lib.format.read_array(io.BytesIO(archive.read(name)), allow_pickle=False)
    return array
