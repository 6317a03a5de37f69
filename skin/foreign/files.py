"""Read event files of all supported foreign formats."""

import zipfile
from collections.abc import Sequence
from pathlib import Path

from eskin.base.errors import InputError
from eskin.base.inputs import not_a_file
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.foreign import aedat4, cameras, tables
from eskin.skin.foreign.address_map import AddressMap
from eskin.skin.foreign.events import CLOCKS, UNITS_S, ForeignEvents, configuration, take

SUFFIXES = (aedat4.SUFFIX, *cameras.SUFFIXES, *tables.TEXT_SUFFIXES, ".npy")
"""Endings of foreign event files; .npz archives from other programs are foreign too."""


def is_foreign(path: Path) -> bool:
    """Return True if a file holds events of another program, judged by suffix or archive members."""
    if path.suffix.lower() != ".npz":
        return path.suffix.lower() in SUFFIXES
    if not_a_file(path):
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            return not {"events.npy", "metadata.npy"} <= set(archive.namelist())
    except (OSError, zipfile.BadZipFile):
        return False  # Recording.load reports the error


def read_foreign(path: Path, fields: Sequence[str] = (), unit: str | None = None) -> ForeignEvents:
    """Return the events from a foreign file; ``fields`` and ``unit`` apply to tables and arrays."""
    if unit not in (None, *UNITS_S, CLOCKS):
        raise InputError(f"--time-unit must be {', '.join(UNITS_S)} or {CLOCKS}, not {unit!r}")
    if path.suffix.lower() not in (aedat4.SUFFIX, *cameras.SUFFIXES):
        return tables.read_events_table(path, fields, unit)
    if fields or unit:
        option = "--fields" if fields else "--time-unit"
        raise InputError(
            f"leave {option} out: it is only for tables, and a {path.suffix} file states its columns and its unit"
        )
    return aedat4.read_aedat4(path) if path.suffix.lower() == aedat4.SUFFIX else cameras.read_camera(path)


def load_foreign(path: Path, mapping: AddressMap | None = None) -> Recording:
    """Return the recording from a foreign file, with a clock of 1 MHz."""
    events = read_foreign(path)
    config = configuration(events, ReadoutConfig(), frozenset(), mapping)
    return take(events, config, mapping, metadata={"name": path.stem, "source": path.name}).recording
