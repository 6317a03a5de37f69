"""Read arrays of samples: .npy, .npz, .mat and .h5."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.packages import missing
from eskin.skin.readers.frame import Frame, check_size, frame_of
from eskin.skin.samples import arrays_in

ARRAY = "samples"
RATE = "sample_rate_hz"
TIME = ("time_s", "time", "t")
NAMES = "columns"


def read_numpy(path: Path, data: bytes, field: str) -> Frame:
    """Return the samples in a .npy file, or in the array ``field`` of a .npz file."""
    kind = path.suffix.lower()
    save = "savez" if kind == ".npz" else "save"
    found = arrays_in(path, data, f"a numerical {kind} file; save it with numpy.{save}")
    if not isinstance(found, np.ndarray):
        return of_arrays(path, found, field)
    if field:
        raise InputError(f"{path} holds one array without a name; leave --field out")
    if found.dtype.names and found.ndim == 1:
        return of_arrays(path, {name: found[name] for name in found.dtype.names}, field)
    return frame_of(path, found)


def read_matlab(path: Path, data: bytes, field: str) -> Frame:
    """Return the samples in the variable ``field`` of a .mat file of version 5 or 7.3."""
    if data[:4] == b"\x89HDF" or data[512:516] == b"\x89HDF":
        return read_hdf5(path, data, field, transposed=True)
    import scipy.io

    try:
        found = scipy.io.loadmat(io.BytesIO(data))
    except Exception:  # the reader raises almost any type, depending on what is damaged
        raise InputError(f"{path} is damaged or not a .mat file; save it again, such as with -v7") from None
    arrays = {name: np.asarray(value) for name, value in found.items() if not name.startswith("__")}
    return of_arrays(
        path, {name: array.squeeze() if 1 in array.shape else array for name, array in arrays.items()}, field
    )


def read_hdf5(path: Path, data: bytes, field: str, transposed: bool = False) -> Frame:
    """Return the samples in the dataset ``field`` of an HDF5 file; MATLAB stores its arrays ``transposed``."""
    h5py = needed("h5py", path)
    arrays: dict[str, NDArray[Any]] = {}

    def take(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and not name.startswith("#") and item.size and item.dtype.kind in "iufb":
            check_size(path, item.size)
            arrays[name] = np.asarray(item[()]).T if transposed else np.asarray(item[()])

    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            file.visititems(take)
            rate = file.attrs.get(RATE)
    except InputError:
        raise
    except Exception:  # as above
        raise InputError(f"{path} is damaged or not an HDF5 file; write it again") from None
    if rate is not None and RATE not in arrays:
        arrays[RATE] = np.asarray(rate)
    if transposed:
        arrays = {name: array.squeeze() if 1 in array.shape else array for name, array in arrays.items()}
    return of_arrays(path, arrays, field)


def of_arrays(path: Path, arrays: Mapping[str, NDArray[Any]], field: str) -> Frame:
    """Return the samples among named arrays: the one named ``field``, else ``samples``, else the only large one.

    Arrays of one dimension and equal length are columns; a time beside the samples is a column of theirs. A single
    number ``sample_rate_hz`` is the rate.
    """
    import pandas

    given = dict(arrays)
    rate = given.pop(RATE, None)
    if rate is not None and (rate.size != 1 or rate.dtype.kind not in "iuf"):
        raise InputError(f"{path} has a {RATE} that is not one number; give it in hertz")
    rate_hz = None if rate is None else float(rate.reshape(()))
    if rate_hz is not None and not (np.isfinite(rate_hz) and rate_hz > 0):
        raise InputError(f"{path} states the sampling rate {rate_hz:g}; it must be a positive number")
    columns = given.pop(NAMES, None) if NAMES in given and given[NAMES].dtype.kind in "US" else None
    names = tuple(map(str, columns.tolist())) if columns is not None else ()
    tables = {name: array for name, array in given.items() if array.ndim >= 2 and array.dtype.kind in "iufb"}
    lines = {name: array for name, array in given.items() if array.ndim == 1 and array.dtype.kind in "iufb"}
    listed = ", ".join(f"{name} {array.shape}" for name, array in (tables | lines).items()) or "nothing"
    if field and field not in tables | lines:
        raise InputError(f"{path} has no array {field!r}; it contains {listed}")
    notes: tuple[str, ...] = ()
    if field in tables or ARRAY in tables or len(tables) == 1:
        name = field or (ARRAY if ARRAY in tables else next(iter(tables)))
        frame = frame_of(path, tables[name], rate_hz, names)
        if len(given) > 1:
            notes = (f"the samples are the array {name!r} of {listed}; --field chooses another",)
        time = next((t for t in TIME if t in lines and len(lines[t]) == len(tables[name])), None)
        if time is None:
            return frame.noting(*notes)
        cells = pandas.concat([pandas.DataFrame({"time": lines[time]}), frame.cells], axis=1, ignore_index=True)
        return Frame(cells, (time, *frame.names), True, notes, rate_hz, frame.shape)
    if field in lines:
        return frame_of(path, lines[field][:, None], rate_hz, (field,))
    if len(tables) > 1:
        raise InputError(f"{path} contains {listed}; choose one with --field NAME, or name it {ARRAY!r}")
    if not lines or len({len(array) for array in lines.values()}) > 1:
        raise InputError(
            f"{path} contains {listed}; name the array of samples {ARRAY!r}, or choose one with --field NAME"
        )
    cells = pandas.DataFrame(dict(enumerate(lines.values())))
    return Frame(cells, tuple(lines), True, (f"each array is a column: {listed}; --field chooses one",), rate_hz)


def needed(module: str, path: Path) -> Any:
    """Return a module that reads a kind of file; raise InputError with the remedy if it is not installed."""
    import importlib

    try:
        return importlib.import_module(module)
    except ImportError:
        raise InputError(f"cannot read {path}: {missing(module.partition('.')[0])}") from None
