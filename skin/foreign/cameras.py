"""Read event files of cameras: EVT 2 and 3 (.raw), DAT (.dat) and Event Stream (.es)."""

from pathlib import Path

import numpy as np

from eskin.base.errors import InputError
from eskin.skin.foreign.events import ForeignEvents
from eskin.skin.readers.arrays import needed

SUFFIXES = (".raw", ".dat", ".es")


def read_camera(path: Path) -> ForeignEvents:
    """Return the events of a camera's file; its times are microseconds.

    Raise InputError if the file cannot be read, or the package faery is missing.
    """
    faery = needed("faery", path)
    if not path.is_file():
        raise InputError(f"cannot read {path}: it is not a file")
    try:
        stream = faery.events_stream_from_file(path)
        packets = [packet.copy() for packet in stream]
        width, height = stream.dimensions()
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # decoders raise many types, and their panics are no Exception
        reason = " ".join(str(error).split())
        raise InputError(f"{path} is damaged or not a {path.suffix.lower()} file of events: {reason}") from None
    if not packets:
        raise InputError(f"{path} holds no events; record it again")
    events = np.concatenate(packets)
    addresses = np.stack([events["x"].astype(np.int64), events["y"].astype(np.int64)], axis=1)
    time = events["t"].astype(np.int64)
    return ForeignEvents(time, "us", addresses, np.asarray(events["on"]), (int(height), int(width)))
