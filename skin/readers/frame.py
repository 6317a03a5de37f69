"""A file's columns, as every reader returns them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError

if TYPE_CHECKING:
    from pandas import DataFrame

MAX_VALUES = 2**27
"""Largest number of values in one file: 1 GiB as floats."""


@dataclass(frozen=True, eq=False)
class Frame:
    """The columns of a file, before any of them is taken for a taxel."""

    cells: DataFrame  # a row for each sample, a column for each quantity; numbers, truth values, dates or text
    names: tuple[str, ...]  # of the columns
    named: bool  # the names are in the file
    notes: tuple[str, ...] = ()  # choices that the reader made, each with the option that changes it
    rate_hz: float | None = None  # samples per second, if the file contains them
    shape: tuple[int, int] | None = None  # rows and columns of the array, if the file has this geometry
    doubt: str = ""  # why its first axis may not be time

    def noting(self, *notes: str) -> Frame:
        """Return a frame with more notes."""
        return replace(self, notes=(*self.notes, *notes))


def numbered(count: int) -> tuple[str, ...]:
    """Return the names of columns without a header: their numbers from 1."""
    return tuple(str(number) for number in range(1, count + 1))


def frame_of(path: Path, values: NDArray[Any], rate_hz: float | None = None, names: tuple[str, ...] = ()) -> Frame:
    """Return the frame of an array of samples, shape (ticks, taxels) or (ticks, rows, columns).

    Raise InputError if the array has another shape, values that are no numbers, or more taxels than samples.
    """
    import pandas

    if values.dtype.kind not in "iuf":
        raise InputError(
            f"{path} holds {values.dtype} values; samples are integers (codes) or floats (full scale +-1.0)"
        )
    if values.ndim not in (2, 3):
        remedy = "; reshape a single taxel to (ticks, 1)" if values.ndim == 1 else ""
        wanted = "(ticks, taxels) or (ticks, rows, columns)"
        raise InputError(f"{path} has the shape {values.shape}; samples have {wanted}{remedy}")
    check_size(path, values.size)
    if not values.size:
        raise InputError(f"{path} has the shape {values.shape}: no samples; give at least one tick and one taxel")
    flat = values.reshape(len(values), -1)
    columns = pandas.DataFrame(np.ascontiguousarray(flat))
    named = len(names) == flat.shape[1]
    shape = (int(values.shape[1]), int(values.shape[2])) if values.ndim == 3 else None
    doubt = _doubt(values.shape)
    return Frame(columns, names if named else numbered(flat.shape[1]), named, (), rate_hz, shape, doubt)


def check_size(path: Path, values: int) -> None:
    """Raise InputError if a file holds more values than fit memory."""
    if values > MAX_VALUES:
        raise InputError(f"{path} holds {values} values, more than {MAX_VALUES}; cut it into shorter recordings")


def _doubt(shape: tuple[int, ...]) -> str:
    """Return a question about an array with more taxels than samples, which may be transposed or a batch."""
    ticks, taxels = shape[0], int(np.prod(shape[1:]))
    if ticks >= taxels or ticks == 1:
        return ""
    first = f"it has the shape {shape}, {taxels} taxels in {ticks} samples"
    if len(shape) == 3 and shape[1] > shape[2]:
        return f"{first}; if it holds {ticks} recordings, save each one as an array (ticks, taxels)"
    return f"{first}; if its first axis is not time, save {'array.T' if len(shape) == 2 else '(ticks, rows, columns)'}"
