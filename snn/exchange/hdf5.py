"""Safe reading of HDF5 files from unknown sources.

An HDF5 file can name other files of this machine, by links, external storage and virtual datasets, whose content would
then be taken for its own, and a few kilobytes of it can claim gigabytes.
"""

import io
from pathlib import Path

import h5py  # type: ignore[import-untyped]

from eskin.base.errors import InputError
from eskin.base.files import MAX_UNPACKED

MAX_OBJECTS = 100_000


def read_hdf5(path: Path, what: str) -> bytes:
    """Return the checked content of an HDF5 file; ``what`` describes the expected content for error messages.

    Raise InputError if it cannot be read, is no HDF5, refers to other files, or claims more than ``MAX_UNPACKED``
    bytes.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None
    try:
        with h5py.File(io.BytesIO(content)) as file:
            _check(file)
    except InputError as error:
        raise InputError(f"{path} {error}") from None
    except Exception:  # a damaged file makes h5py raise almost any type
        raise InputError(f"{path} is damaged or not {what}") from None
    return content


def _check(file: h5py.File) -> None:
    size, seen, waiting = 0, set(), [file["/"]]
    while waiting:
        group = waiting.pop()
        place = h5py.h5o.get_info(group.id).addr
        if place in seen:
            raise InputError(f"has a group that contains itself, {group.name!r}; export it again")
        seen.add(place)
        for name in group:
            link = group.get(name, getlink=True)
            if not isinstance(link, h5py.HardLink):
                raise InputError(f"links {name!r} to another object or file; export it completely")
            found = group[name]
            if isinstance(found, h5py.Dataset):
                if found.external or found.is_virtual:
                    raise InputError(f"refers to another file for {found.name!r}; export it completely")
                size += found.nbytes
            elif isinstance(found, h5py.Group):
                waiting.append(found)
            if size > MAX_UNPACKED or len(seen) + len(waiting) > MAX_OBJECTS:
                raise InputError(f"claims more than {MAX_UNPACKED // 2**20} MiB of data, and is refused")
