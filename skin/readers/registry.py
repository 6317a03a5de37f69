"""Registry of the readers of recordings, by suffix."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from eskin.base.errors import InputError
from eskin.base.files import MAX_TEXT_BYTES, MAX_UNPACKED
from eskin.skin.readers import arrays, sound, tables
from eskin.skin.readers.bags import read_bag
from eskin.skin.readers.frame import Frame
from eskin.skin.readers.text import Layout, read_text
from eskin.skin.samples import content_of


@dataclass(frozen=True)
class Source:
    """Where the samples are in a file, and how its text is to be read."""

    layout: Layout = field(default_factory=Layout)
    topic: str = ""  # of a bag
    part: str = ""  # array, variable, dataset, sheet, or field of a message


Read = Callable[[Path, bytes, Source], Frame]

READERS: dict[str, Read] = {
    ".csv": lambda path, data, source: read_text(path, data, source.layout),
    ".npy": lambda path, data, source: arrays.read_numpy(path, data, source.part),
    ".mat": lambda path, data, source: arrays.read_matlab(path, data, source.part),
    ".h5": lambda path, data, source: arrays.read_hdf5(path, data, source.part),
    ".parquet": lambda path, data, source: tables.read_arrow(path, data),
    ".xlsx": lambda path, data, source: tables.read_excel(path, data, source.part),
    ".json": lambda path, data, source: tables.read_json_table(path, data, source.part),
    ".wav": lambda path, data, source: sound.read_wav(path, data),
}
for alias, suffix in {
    ".tsv": ".csv",
    ".txt": ".csv",
    ".dat": ".csv",
    ".npz": ".npy",
    ".hdf5": ".h5",
    ".feather": ".parquet",
    ".jsonl": ".json",
}.items():
    READERS[alias] = READERS[suffix]
BAGS = (".bag", ".mcap", ".db3")
SUFFIXES = (*READERS, *BAGS)
"""Suffixes of the files with samples that can be read, in lower case."""

_TEXT = (".csv", ".tsv", ".txt", ".dat", ".json", ".jsonl")
_LFS = b"version https://git-lfs"


def read_frame(path: Path, source: Source | None = None) -> Frame:
    """Return the columns of a file of samples of any supported kind.

    Raise InputError if the file cannot be read, is of an unknown kind, or holds no samples.
    """
    source, suffix = source or Source(), path.suffix.lower()
    if suffix in (".pkl", ".pickle", ".joblib"):
        raise InputError(
            f"{path} is a pickle, which can run any program when it is read; convert it where you trust it: "
            f"import pandas; pandas.read_pickle({path.name!r}).to_csv({path.stem + '.csv'!r})"
        )
    if suffix not in SUFFIXES:
        raise InputError(f"{path} is not a file of samples; accepted are {', '.join(SUFFIXES)}")
    if suffix in BAGS:
        return read_bag(path, source.topic, source.part)
    data = content_of(path, "the file of samples", MAX_TEXT_BYTES if suffix in _TEXT else MAX_UNPACKED)
    if not data:
        raise InputError(f"{path} is empty; fetch or record it again")
    if data.startswith(_LFS):
        raise InputError(f"{path} is a Git LFS pointer, not the file itself; fetch it with git lfs pull")
    return READERS[suffix](path, data, source)
