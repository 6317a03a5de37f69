"""Read and write AEDAT 4, the event files of iniVation cameras, with the library dv-processing."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from eskin.base.errors import InputError
from eskin.base.files import atomic_write
from eskin.base.packages import missing
from eskin.model.events.recording import Recording
from eskin.skin.foreign.events import ForeignEvents, in_unit, lost_clocks

SUFFIX = ".aedat4"


def _library() -> Any:
    try:
        import dv_processing
    except ImportError:
        raise InputError(missing("dv_processing")) from None
    return dv_processing


def read_aedat4(path: Path) -> ForeignEvents:
    """Return the events from an AEDAT 4 file, with time stamps in microseconds.

    Raise InputError if the file cannot be read, or has no events.
    """
    dv = _library()
    try:
        with path.open("rb") as file:
            if file.read(14) != b"#!AER-DAT4.0\r\n":
                raise InputError(f"{path} is not an AEDAT 4 file; convert older versions with dv-processing first")
        source = dv.io.MonoCameraRecording(str(path))
        if not source.isEventStreamAvailable():
            raise InputError(f"{path} has no stream of events; record events, not only frames")
        columns, rows = source.getEventResolution()
        batches = []
        while source.isRunning() and (batch := source.getNextEventBatch()) is not None:
            batches.append(batch.numpy())
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from None
    except RuntimeError:
        raise InputError(f"{path} is damaged; record it again") from None
    found = (
        np.concatenate(batches) if batches else np.empty(0, [(n, "<i8") for n in ("timestamp", "x", "y", "polarity")])
    )
    return ForeignEvents(
        found["timestamp"].astype(np.int64),
        "us",
        np.stack([found["x"], found["y"]], axis=1).astype(np.int64),
        found["polarity"].astype(bool),
        (int(rows), int(columns)),
    )


def write_aedat4(path: Path, recording: Recording) -> str:
    """Write a recording as an AEDAT 4 file; return a warning about lost time resolution, or an empty text.

    Time stamps are microseconds since the end of reset, rounded half to even.
    """
    dv = _library()
    if not len(recording.events):
        raise InputError(
            "the recording has no events, and AEDAT 4 cannot store an empty stream; convert another recording"
        )
    events = in_unit(recording, "us")
    store = dv.EventStore()
    for t, x, y, p in events.tolist():
        store.push_back(t, x, y, p)
    config = recording.config
    with tempfile.TemporaryDirectory() as folder:
        draft = Path(folder) / "events.aedat4"
        size = (config.columns, config.rows)
        writer = dv.io.MonoCameraWriter(str(draft), dv.io.MonoCameraWriter.EventOnlyConfig("eskin", size))
        writer.writeEvents(store)
        del writer  # closes the file
        with atomic_write(path) as out:
            out.write(draft.read_bytes())
    return lost_clocks(recording.events["t"], events["t"])
