"""Journal file that preserves received events after a lost cable, a killed program or a power cut."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from eskin.base.errors import InputError
from eskin.base.inputs import not_a_file
from eskin.model.address_events import EVENT_DTYPE
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording, check_event_path

SUFFIX = ".part"


class Journal:
    """Partial event file of a recording: a JSON header, then events in binary."""

    def __init__(self, path: Path, config: ReadoutConfig, metadata: dict[str, Any]) -> None:
        check_event_path(path)
        self.path, self.part = path, path.with_name(path.name + SUFFIX)
        if self.part.exists():
            raise InputError(f"{self.part} holds an unfinished recording; eskin rescue {self.part} completes it")
        self.count, self.last = 0, -1
        header = json.dumps({"config": config.to_dict(), "metadata": metadata})
        try:
            self._file = self.part.open("xb", buffering=0)
        except OSError as error:
            raise InputError(f"cannot write {self.part}: {error.strerror}") from None
        self._file.write(header.encode() + b"\n")

    def add(self, events: Iterable[tuple[int, int, int, bool]]) -> None:
        """Append events (clock, column, row, polarity) to the journal."""
        array = np.array(list(events), EVENT_DTYPE)
        if len(array):
            self.count += len(array)
            self.last = int(array["t"][-1])
            self._file.write(array.tobytes())

    def discard(self) -> None:
        """Remove the journal of an empty recording."""
        self._file.close()
        self.part.unlink()

    def finish(self, duration_clocks: int | None = None, **metadata: Any) -> Recording:
        """Write the recording as an event file with more metadata, and remove the journal.

        The duration is that of the observation, by default up to the last event.
        """
        self._file.close()
        return convert(self.part, self.path, duration_clocks, metadata)


def convert(
    part: Path, path: Path | None = None, duration_clocks: int | None = None, more: dict[str, Any] | None = None
) -> Recording:
    """Convert a journal to an event file and remove the journal.

    Where the clock runs backwards, because the board was reset, a new recording begins, with ``-2``, ``-3`` ... behind
    the name. Raises InputError if the file is no journal, or contains events that its array cannot have.
    """
    if what := not_a_file(part):
        raise InputError(f"{part} is {what}; give a file that ends in .npz{SUFFIX}")
    try:
        head, _, body = part.read_bytes().partition(b"\n")
    except OSError as error:
        raise InputError(f"cannot read {part}: {error.strerror}") from None
    try:
        header = json.loads(head)
        config, metadata = ReadoutConfig.from_dict(header["config"]), header["metadata"] | (more or {})
    except (ValueError, KeyError, TypeError, RecursionError):
        raise InputError(
            f"{part} is not a partial recording, or its start is lost; give another .npz{SUFFIX}"
        ) from None
    path = path or part.with_suffix("")
    check_event_path(path)
    whole = len(body) // EVENT_DTYPE.itemsize  # a power cut may leave half an event
    events = np.frombuffer(body[: whole * EVENT_DTYPE.itemsize], EVENT_DTYPE)
    made = []
    for number, piece in enumerate(pieces := np.split(events, np.flatnonzero(np.diff(events["t"]) < 0) + 1)):
        least = int(piece["t"][-1]) + 1 if len(piece) else 0
        observed = max(duration_clocks or 0, least) if number == len(pieces) - 1 else least
        try:
            made.append(Recording(piece, config, observed, metadata=metadata))
        except InputError as error:
            raise InputError(f"{part} holds events outside its array: {error}; remove it") from None
    for number, recording in enumerate(made, 1):
        recording.save(path if number == 1 else path.with_stem(f"{path.stem}-{number}"))
    part.unlink()
    return made[0]
