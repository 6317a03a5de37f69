"""Read and write AEDAT 4, the event files of iniVation cameras, with the library dv-processing."""

import struct
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from eskin.base.errors import InputError
from eskin.base.files import atomic_write, read_arrays
from eskin.base.inputs import check_ends
from eskin.base.packages import missing
from eskin.model.events.recording import Recording
from eskin.skin.foreign import aedat4_process
from eskin.skin.foreign.events import ForeignEvents, in_unit, lost_clocks

SUFFIX = ".aedat4"
MAGIC = b"#!AER-DAT4.0\r\n"

START_S, LEAST_BYTES_PER_S = 20.0, 1e6
"""Time limit for the library: its start, and its lowest speed."""


def _library() -> Any:
    try:
        import dv_processing
    except ImportError:
        raise InputError(missing("dv_processing")) from None
    return dv_processing


def read_aedat4(path: Path) -> ForeignEvents:
    """Return the events from an AEDAT 4 file, with time stamps in microseconds.

    Raise InputError if the file cannot be read, is cut off or damaged, or has no events.
    """
    _library()
    damaged = f"{path} is damaged; record it again"
    try:
        _check_whole(path)
        limit_s = START_S + path.stat().st_size / LEAST_BYTES_PER_S
        with tempfile.TemporaryDirectory() as folder:
            kept = Path(folder) / "events.npz"
            command = [sys.executable, "-m", aedat4_process.__name__, str(path.absolute()), str(kept)]
            done = subprocess.run(command, capture_output=True, timeout=limit_s, check=False)
            if done.returncode == aedat4_process.NO_STREAM:
                raise InputError(f"{path} has no stream of events; record events, not only frames")
            if done.returncode:
                raise InputError(damaged)
            found = read_arrays(kept, "the events of a camera", "read them again")
    except subprocess.TimeoutExpired:
        raise InputError(f"{path} is damaged: its events cannot be read in {limit_s:.0f} s; record it again") from None
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from None
    except struct.error:
        raise InputError(damaged) from None
    rows, columns = found["size"].tolist()
    return ForeignEvents(
        found["timestamp"].astype(np.int64),
        "us",
        np.stack([found["x"], found["y"]], axis=1).astype(np.int64),
        found["polarity"].astype(bool),
        (rows, columns),
    )


def _check_whole(path: Path) -> None:
    """Check that the packets of a file fill it exactly up to its table of packets, or to its end without a table.

    The header is a FlatBuffer with its length in front. Its second field is the place of the table, -1 if the
    recording was not closed. A packet is the number of its stream, its length, and its content.
    """
    check_ends(path)
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise InputError(f"{path} is not an AEDAT 4 file; convert older versions with dv-processing first")
        size = path.stat().st_size
        (length,) = struct.unpack("<I", file.read(4))
        at = len(MAGIC) + 4 + length
        header = file.read(length) if at <= size else b""
        (root,) = struct.unpack_from("<I", header)
        fields = root - struct.unpack_from("<i", header, root)[0]
        (field,) = struct.unpack_from("<H", header, fields + 6) if fields >= 0 else (0,)
        end = struct.unpack_from("<q", header, root + field)[0] if field else -1
        if end > size:
            raise InputError(f"{path} is cut off: it has {size} bytes, its packets {end}; copy or record it again")
        end = size if end < 0 else end
        while at < end:
            file.seek(at)
            _, length = struct.unpack("<ii", file.read(8))
            at += 8 + max(length, 0)
        if at != end:
            raise InputError(f"{path} is cut off or damaged: a packet ends at byte {at} of {end}; record it again")


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
