"""Events on disk as they come: what was received outlives a lost cable, a killed program and a power cut."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from eskin.base.errors import InputError
from eskin.model.address_events import EVENT_DTYPE
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording, check_event_path

SUFFIX = ".part"


class Journal:
    """A file beside the recording, which becomes it at the end: a line of JSON, then events as they stand in memory.

    Parameters
    ----------
    path : Path
        Of the recording.
    config : ReadoutConfig
    metadata : dict
    """

    def __init__(self, path: Path, config: ReadoutConfig, metadata: dict[str, Any]) -> None:
        check_event_path(path)
        self.path, self.part = path, path.with_name(path.name + SUFFIX)
        if self.part.exists():
            raise InputError(
                f"{self.part} holds events that became no recording; eskin rescue {self.part} makes it one"
            )
        self.count, self.last = 0, -1
        header = json.dumps({"config": config.to_dict(), "metadata": metadata})
        try:
            self._file = self.part.open("xb", buffering=0)
        except OSError as error:
            raise InputError(f"cannot write {self.part}: {error.strerror}") from None
        self._file.write(header.encode() + b"\n")

    def add(self, events: Iterable[tuple[int, int, int, bool]]) -> None:
        """Append events (clock, column, row, polarity)."""
        array = np.array(list(events), EVENT_DTYPE)
        if len(array):
            self.count += len(array)
            self.last = int(array["t"][-1])
            self._file.write(array.tobytes())

    def discard(self) -> None:
        """Remove the journal: nothing came."""
        self._file.close()
        self.part.unlink()

    def finish(self, duration_clocks: int | None = None, **metadata: Any) -> Recording:
        """Write the recording and remove the journal.

        Parameters
        ----------
        duration_clocks : int, optional
            Clocks that were observed; up to the last event by default.
        metadata
            What the recording says besides.
        """
        self._file.close()
        return convert(self.part, self.path, duration_clocks, metadata)


def convert(
    part: Path, path: Path | None = None, duration_clocks: int | None = None, more: dict[str, Any] | None = None
) -> Recording:
    """Make the recording of a journal, and remove the journal.

    Raises
    ------
    InputError
        If the file is no journal.
    """
    try:
        head, _, body = part.read_bytes().partition(b"\n")
    except OSError as error:
        raise InputError(f"cannot read {part}: {error.strerror}") from None
    try:
        header = json.loads(head)
        config, metadata = ReadoutConfig.from_dict(header["config"]), header["metadata"]
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{part} is no journal of a recording; give a file that ends in .npz{SUFFIX}") from None
    whole = len(body) // EVENT_DTYPE.itemsize  # a power cut may leave half an event
    events = np.frombuffer(body[: whole * EVENT_DTYPE.itemsize], EVENT_DTYPE)
    least = int(events["t"][-1]) + 1 if whole else 0
    recording = Recording(events, config, max(duration_clocks or 0, least), metadata=metadata | (more or {}))
    recording.save(path or part.with_suffix(""))
    part.unlink()
    return recording
