"""Check output paths before any work, and protect files that no command wrote."""

import contextlib
import fcntl
import functools
import os
import re
import stat
import tempfile
from collections.abc import Iterable
from pathlib import Path

from eskin.base.errors import InputError

OUT = Path("out")
"""Default output folder of the commands, created if missing."""

PART = ".part"  # ending of a file that is being written
MAX_NAME = 255  # largest number of bytes in the name of a file or folder
_MAX_LINKS = 40
_PREFIX = 60  # characters of a name in the name of its temporary file, which fits into ``MAX_NAME`` bytes


def file_of(path: Path) -> Path:
    """Return an output path with its links resolved, after checking that the file is writable.

    The file need not exist, and is not created. Raises InputError if it is a folder or socket, its folder does not
    exist, its name is too long, or the user may not write it.
    """
    _check_length(path)
    target = _behind_links(path)
    check_file(target)
    if not is_stream(target):
        if target.exists() and not os.access(target, os.W_OK):
            raise InputError(f"cannot write {target}: Permission denied")
        _probe(target, _nearest(target.parent))
    return target


def check_file(path: Path) -> None:
    """Check that a path can be an output file."""
    _check_length(path)
    mode = _mode(path)
    if stat.S_ISDIR(mode):
        raise InputError(f"cannot write {path}: it is a folder; give the name of a file")
    if stat.S_ISSOCK(mode):
        raise InputError(f"cannot write {path}: it is a socket; give the name of a file")
    if is_stream(path):
        if not os.access(path, os.W_OK):
            raise InputError(f"cannot write {path}: Permission denied")
    elif not (path.parent.is_dir() or in_out(path.parent)):
        raise InputError(f"cannot write {path}: the folder {path.parent} does not exist; create it first")


def check_folder(path: Path) -> None:
    """Check that an output folder exists or can be created, and is writable; else raise InputError."""
    _check_length(path)
    if _mode(path) and not path.is_dir():
        raise InputError(f"cannot write to {path}: it is a file; give the name of a folder")
    nearest = _nearest(path)
    if nearest.is_symlink() and not nearest.exists():
        raise InputError(f"cannot write to {path}: {nearest} is a link to {os.readlink(nearest)}, which does not exist")
    if not nearest.is_dir():
        raise InputError(f"cannot write to {path}: {nearest} is a file; give a folder in another place")
    _probe(path, nearest)


def missing_folders(path: Path) -> list[Path]:
    """Return an output path and the folders above it that do not exist, the deepest first."""
    return [one for one in (path, *path.parents) if not one.exists() and not one.is_symlink()]


def remove_empty(folders: Iterable[Path]) -> None:
    """Remove the empty folders among these folders and all folders in them."""
    for folder in folders:
        for place, _, _ in os.walk(folder, topdown=False):
            with contextlib.suppress(OSError):
                os.rmdir(place)


def in_out(folder: Path) -> bool:
    """Return True if a folder is the default output folder or below it."""
    return folder.parts[:1] == OUT.parts and ".." not in folder.parts


def is_stream(path: Path) -> bool:
    """Return True if a path must be written directly: a device, a FIFO, or an open file."""
    if re.fullmatch(r"/dev/fd|/proc/[^/]+/fd", str(path.parent)):
        return True
    try:
        mode = path.lstat().st_mode
    except OSError:
        return False
    return stat.S_ISCHR(mode) or stat.S_ISBLK(mode) or stat.S_ISFIFO(mode)


def has_earlier(path: Path | None) -> bool:
    """Return True if a regular output file already exists."""
    return path is not None and path.exists() and not is_stream(path)


def _behind_links(path: Path) -> Path:
    for _ in range(_MAX_LINKS):
        if is_stream(path) or not path.is_symlink():
            return path
        path = path.parent / os.readlink(path)
    raise InputError(f"cannot write {path}: it is a link to itself; remove it")


def new_part(path: Path) -> tuple[int, str]:
    """Return the handle and the name of a new, locked temporary file beside ``path``.

    Files left by killed processes for the same path are removed.
    """
    prefix = f".{path.name[:_PREFIX]}."
    for name in _parts_in(str(path.parent.absolute())):
        if name.startswith(prefix) and len(name) == len(prefix) + 8 + len(PART):
            _remove_if_abandoned(path.with_name(name))
    while True:
        handle, name = tempfile.mkstemp(prefix=prefix, suffix=PART, dir=path.parent)
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(handle, fcntl.LOCK_EX)
        if os.fstat(handle).st_nlink:
            return handle, name
        os.close(handle)  # another process removed the file as abandoned before it was locked


@functools.cache
def _parts_in(folder: str) -> list[str]:
    """Return the names of the temporary files that a folder contained when this process first wrote there."""
    try:
        return [name for name in os.listdir(folder) if re.fullmatch(r"\..+\.[a-z0-9_]{8}\.part", name)]
    except OSError:
        return []


def _remove_if_abandoned(part: Path) -> None:
    """Remove a temporary file of this user if no running process holds it."""
    with contextlib.suppress(OSError):
        if not stat.S_ISREG(part.lstat().st_mode) or part.lstat().st_uid != os.getuid():
            return
        handle = os.open(part, os.O_RDONLY | os.O_NOFOLLOW)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            part.unlink()
        finally:
            os.close(handle)


def _mode(path: Path) -> int:
    """Return the file mode of a path after links; 0 if the target does not exist."""
    try:
        return path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return 0
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}") from None


def _check_length(path: Path) -> None:
    """Check that a file name is not too long for the file system."""
    for part in path.parts:
        if len(os.fsencode(part)) > MAX_NAME:
            raise InputError(f"cannot write {part[:40]}...: the name has more than {MAX_NAME} bytes; shorten it")


def _nearest(folder: Path) -> Path:
    """Return the folder itself, or its nearest existing parent."""
    while not (folder.exists() or folder.is_symlink()) and folder != folder.parent:
        folder = folder.parent
    return folder


def _probe(path: Path, folder: Path) -> None:
    """Check that a file can be created in a folder."""
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror} in {folder}") from None
