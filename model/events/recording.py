"""Event recordings in memory and in files (docs/specification.md, section 5; docs/guide/files.md)."""

from __future__ import annotations

import json
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base import formats
from eskin.base.errors import InputError
from eskin.base.files import read_arrays, write_arrays
from eskin.model import __version__
from eskin.model.address_events import Events, check_events
from eskin.model.config import ReadoutConfig
from eskin.model.tiles.config import config_of

MAX_CLOCKS = 2**51
"""Clocks up to which a time in seconds (float64) names its clock: t / clock_hz and its product with clock_hz are each
rounded by at most one part in 2**53, together by less than half a clock."""

_HEADER_TYPES: dict[str, type] = {
    "clock_hz": float,
    "duration_clocks": int,
    "version": str,
    "config": dict,
    "metadata": dict,
}


@dataclass(frozen=True, eq=False)
class Recording:
    """Address events with their configuration, duration and metadata; immutable and validated.

    Examples
    --------
    >>> from eskin.model.config import ReadoutConfig
    >>> from eskin.model.address_events import EVENT_DTYPE
    >>> events = np.array([(11, 0, 0, True), (12, 1, 0, False)], EVENT_DTYPE)
    >>> recording = Recording(events, ReadoutConfig(rows=1, columns=2), 1280, metadata={"label": "brick"})
    >>> recording.duration_s, recording.rate_hz
    (0.001, 2000.0)
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     recording.save(Path(folder) / "brick.npz")
    ...     Recording.load(Path(folder) / "brick.npz") == recording
    True
    """

    events: Events
    """Events in order of transfer, shape (events,); stored as a read-only copy."""
    config: ReadoutConfig
    """The readout that sent them, or the skin of tiles (``TilesConfig``)."""
    duration_clocks: int
    """Length in clocks; all events have ``0 <= t < duration_clocks``. Rates are events divided by the length."""
    version: str = __version__
    """Version of the program that recorded."""
    metadata: dict[str, Any] = field(default_factory=dict)
    """Any other JSON values: name, label, source, ..."""

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
        """Clock frequency in hertz; t / clock_hz is the time of an event in seconds."""
        return self.config.clock_hz

    def __repr__(self) -> str:
        array = f"{self.config.rows} x {self.config.columns} taxels"
        return f"Recording({len(self.events)} events of {array} in {self.duration_s:g} s)"

    @property
    def duration_s(self) -> float:
        """Length of the recording in seconds."""
        return self.duration_clocks / self.clock_hz

    @property
    def rate_hz(self) -> float:
        """Events per second of the whole array."""
        return len(self.events) / self.duration_s if self.duration_clocks else 0.0

    def _header(self) -> dict[str, Any]:
        return {
            "format": formats.EVENTS.name,
            "format_version": formats.EVENTS.version,
            "version": self.version,
            "clock_hz": self.clock_hz,
            "duration_clocks": self.duration_clocks,
            "config": self.config.to_dict(),
            "metadata": self.metadata,
        }

    def save(self, path: str | Path) -> None:
        """Write the recording to an ``.npz`` file."""
        path = Path(path)
        check_event_path(path)
        try:
            text = json.dumps(self._header(), allow_nan=False)
        except (TypeError, ValueError) as error:
            raise InputError(f"the metadata of a recording must be plain JSON values: {error}") from None
        write_arrays(path, {"events": self.events, "metadata": np.array(text)}, compressed=True)

    @classmethod
    def load(cls, path: str | Path) -> Recording:
        """Return the recording from an ``.npz`` file written by :meth:`save`; raise InputError for any other file."""
        path = Path(path)
        if path.suffix.lower() != ".npz" and path.is_file() and not zipfile.is_zipfile(path):
            raise InputError(f"{path} is not an event file; convert events of another program with eskin convert")
        arrays = read_arrays(path, "an event file", "record it again with eskin encode")
        metadata = arrays.get("metadata", np.zeros(0))
        if "events" not in arrays or metadata.dtype.kind != "U" or metadata.ndim:
            raise InputError(f"{path} is an archive, but not an event file; make one with eskin encode")
        try:
            return cls._from_parts(arrays["events"], str(metadata))
        except InputError as error:
            raise InputError(f"{path} is not a valid event file: {error}; record it again") from None

    @classmethod
    def _from_parts(cls, events: NDArray[Any], text: str) -> Recording:
        try:
            header = json.loads(text)
        except (ValueError, RecursionError):
            raise InputError("its metadata are not JSON") from None
        try:
            formats.EVENTS.check(header)
        except KeyError:
            raise InputError(f"its format is not {formats.EVENTS.name!r}") from None
        for name, kind in _HEADER_TYPES.items():
            if type(header.get(name)) is not kind:
                raise InputError(f"its metadata lack a valid {name}")
        if header["duration_clocks"] > MAX_CLOCKS:
            raise InputError(f"its duration_clocks {header['duration_clocks']} are more than 2**51")
        config = config_of(header["config"])
        if header["clock_hz"] != config.clock_hz:
            raise InputError(f"its clock_hz {header['clock_hz']:g} differs from its configuration")
        return cls(events, config, header["duration_clocks"], header["version"], header["metadata"])


def check_event_path(path: Path) -> None:
    """Check that the suffix of an output file names a known event format."""
    if path.suffix != ".npz":
        raise InputError(f"event files end in .npz, {path.name} does not; rename the output")
