"""Fit samples to an array, and write reconstructed signals (docs/guide/files.md)."""

import io
import math
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.files import MAX_TEXT_BYTES, atomic_write, check_unpacked, read_bytes
from eskin.base.outputs import check_file
from eskin.model.config import MAX_SIDE

SIGNAL_SUFFIXES = (".npy", ".npz", ".csv")


def content_of(path: Path, what: str, most: int = MAX_TEXT_BYTES) -> bytes:
    """Return the content of a file; raise InputError if it cannot be read, or is longer than ``most`` bytes."""
    try:
        return read_bytes(path, what, most)
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None


def arrays_in(path: Path, data: bytes, damaged: str) -> NDArray[Any] | dict[str, NDArray[Any]]:
    """Return the array in the content of a .npy file, or the arrays in that of a .npz file by name.

    Raise InputError with the text ``damaged`` if the content cannot be read.
    """
    try:
        if path.suffix.lower() != ".npz":
            return np.asarray(np.lib.format.read_array(io.BytesIO(data), allow_pickle=False))
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            check_unpacked(archive)
            members = {name.removesuffix(".npy"): io.BytesIO(archive.read(name)) for name in archive.namelist()}
        return {name: np.lib.format.read_array(member, allow_pickle=False) for name, member in members.items()}
    except InputError as error:
        raise InputError(f"{path} {error}") from None
    except Exception:  # zipfile, zlib and NumPy raise almost any type, depending on what is damaged
        raise InputError(f"{path} is damaged or not {damaged}") from None


def fit_array(values: NDArray[Any], rows: int, columns: int, size_given: bool) -> tuple[NDArray[Any], int, int]:
    """Return samples reshaped to (ticks, rows * columns), and the array size.

    Raise InputError if the values do not fit the array; the text suggests a size.

    - ``values``: shape (ticks, taxels) or (ticks, rows, columns).
    - ``rows``, ``columns``: array size wanted.
    - ``size_given``: whether the user chose it; if not, values of three dimensions bring their own.
    """
    shape = values.shape[1:]
    flat = values.reshape(len(values), -1)
    if len(shape) == 2 and not size_given:
        rows, columns = int(shape[0]), int(shape[1])
    elif shape not in ((rows, columns), (rows * columns,)):
        if len(shape) == 2:
            raise InputError(
                f"the samples have {shape[0]} x {shape[1]} taxels, but the array has {rows} x {columns}; "
                f"use --rows {shape[0]} --columns {shape[1]}"
            )
        raise InputError(
            f"the samples have {shape[0]} columns, but the array has {rows} x {columns} = {rows * columns} "
            f"taxels; {_suggest_size(shape[0])}"
        )
    return flat, rows, columns


def array_of(taxels: int) -> tuple[int, int] | None:
    """Return rows and columns of the most square array for a number of taxels; None above 64 x 64."""
    for rows in range(math.isqrt(taxels), 0, -1):
        if taxels % rows == 0 and taxels // rows <= MAX_SIDE:
            return rows, taxels // rows
    return None


def _suggest_size(taxels: int) -> str:
    """Return a hint: an array size for a number of taxels, or the advice to leave taxels out."""
    if taxels <= MAX_SIDE:
        return f"use --rows 1 --columns {taxels}"
    if size := array_of(taxels):
        return f"use --rows {size[0]} --columns {size[1]}, or another split of {taxels}"
    return f"no array of at most {MAX_SIDE} x {MAX_SIDE} has {taxels} taxels, so leave some out"


def check_samples_path(path: Path) -> None:
    """Check the format and the folder of an output path before any work."""
    if path.suffix.lower() not in SIGNAL_SUFFIXES:
        raise InputError(f"signals are written as {', '.join(SIGNAL_SUFFIXES)}, not {path.name}; rename the output")
    check_file(path)


def write_samples(
    path: Path, values: NDArray[np.float64], rate_hz: float, names: Sequence[str] = (), start_s: float | None = None
) -> None:
    """Write signals, shape (ticks, taxels), in full scale, to a file that the readers can read.

    The .npz also holds the sampling rate. The .csv has a header and twelve decimals.

    - ``values``: shape (ticks, taxels).
    - ``names``: names of the taxels; others than one for each taxel are not written.
    - ``start_s``: time of the first sample in seconds; with it, .csv and .npz hold the time of every sample.
    """
    check_samples_path(path)
    named = list(names) if len(names) == values.shape[1] else []
    time_s = None if start_s is None else start_s + np.arange(len(values)) / rate_hz
    with atomic_write(path) as file:
        if path.suffix.lower() == ".npz":
            more: dict[str, Any] = {"columns": np.array(named)} if named else {}
            more |= {} if time_s is None else {"time_s": time_s}
            np.savez_compressed(file, samples=values, sample_rate_hz=np.array(rate_hz), **more)
        elif path.suffix.lower() == ".npy":
            np.save(file, values)
        else:
            columns = named or [f"taxel {i}" for i in range(values.shape[1])]
            columns = [f'"{name}"' if "," in name else name for name in columns]
            if time_s is not None:
                columns, values = ["time_s", *columns], np.column_stack([time_s, values])
            np.savetxt(
                file, values, fmt="%.12f", delimiter=",", header=",".join(columns), comments="", encoding="utf-8"
            )
