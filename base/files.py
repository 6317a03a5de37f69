"""Write files atomically."""

from __future__ import annotations

import contextlib
import datetime
import hashlib
import io
import json
import math
import os
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from eskin.base.errors import InputError
from eskin.base.inputs import check_ends
from eskin.base.outputs import check_file, in_out, is_stream, new_part

if TYPE_CHECKING:  # the launcher of make runs where NumPy is not installed yet
    from numpy.typing import NDArray


@contextlib.contextmanager
def atomic_write(path: Path) -> Iterator[IO[bytes]]:
    """Open a binary file that appears under ``path`` only after it is complete.

    The bytes go to a temporary file in the same folder, which replaces ``path`` at the end and is removed on any error.
    An interrupted command therefore leaves the old file, or none. A device or FIFO receives all bytes at the end. A
    link is replaced: commands resolve the user's links first (``eskin.base.outputs.file_of``), and a link planted in a
    folder of the program must not select the overwritten file.

    Raises
    ------
    InputError
        If the folder does not exist or the file cannot be written.
    """
    check_file(path)
    if is_stream(path):
        with io.BytesIO() as memory:
            yield memory
            content = memory.getvalue()
        try:
            path.write_bytes(content)
        except OSError as error:
            raise InputError(f"cannot write {path}: {error.strerror}") from None
        return
    try:
        if in_out(path.parent):
            path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = new_part(path)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}") from None
    lock = os.dup(handle)
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
        os.umask(mask := os.umask(0))  # umask() returns the mask only when setting another
        os.chmod(name, 0o666 & ~mask)
        os.replace(name, path)
    except OSError as error:
        os.unlink(name)
        raise InputError(f"cannot write {path}: {error.strerror}") from None
    except BaseException:
        os.unlink(name)
        raise
    finally:
        os.close(lock)


def make_folder(root: Path, inside: str | Path, empty: bool = False) -> Path:
    """Create an output folder ``inside`` the user's folder, optionally without its old content, and return its path.

    The user's folder may be a link. A link further inside raises InputError, since whoever planted it would choose
    which files are overwritten.
    """
    root.mkdir(parents=True, exist_ok=True)
    folder = root
    for part in Path(inside).parts:
        folder /= part
        if folder.is_symlink():
            raise InputError(f"cannot write to {folder}: it is a link to another place; remove it")
        folder.mkdir(exist_ok=True)
    if empty:
        shutil.rmtree(folder)
        folder.mkdir()
    return folder


@contextlib.contextmanager
def refusing_a_full_disk(folder: Path) -> Iterator[None]:
    """Raise InputError if the enclosed work fails because the disk of a folder is full."""
    try:
        yield
    except Exception:
        try:
            with tempfile.TemporaryFile(dir=folder) as probe:
                probe.write(bytes(2**17))  # a disk that is not full has room for these
        except OSError as error:
            raise InputError(f"cannot write to {folder}: {error.strerror}") from None
        raise


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write a JSON file atomically, with infinite and NaN floats as strings."""
    with atomic_write(path) as file:
        file.write((json.dumps(plain(content), indent=1, allow_nan=False) + "\n").encode())


def digest(content: Any) -> str:
    """Return a short digest of content that JSON can hold."""
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:12]


def origin(command: str) -> dict[str, str]:
    """Return the origin of a result: command, source commit and date."""
    describe = ["git", "describe", "--always", "--dirty"]
    commit = subprocess.run(describe, cwd=Path(__file__).parent, capture_output=True, text=True).stdout.strip()
    return {"command": command, "commit": commit, "date": datetime.date.today().isoformat()}


MAX_TEXT_BYTES = 2**28  # largest text file; a device may never end


def read_bytes(path: Path, what: str, most: int = MAX_TEXT_BYTES) -> bytes:
    """Return the content of a file; raise InputError if it may never end or is longer than ``most`` bytes."""
    check_ends(path)
    with path.open("rb") as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise InputError(f"{what} {path} has more than {most >> 20} MiB; give a smaller file")
    return content


def read_json(path: Path, what: str, kind: type | None = None) -> Any:
    """Return the content of a JSON file, of type ``kind``: ``dict``, ``list`` or any.

    ``what`` names the file in error messages, such as "the sweep". Raises InputError if the file cannot be read, is not
    JSON, is nested too deeply, or is of another type.
    """
    try:
        content = json.loads(read_bytes(path, what), parse_int=_whole)
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"cannot read {what} {path}: {error.strerror}") from None
    except ValueError as error:  # includes UnicodeDecodeError, for bytes that are no text
        raise InputError(f"{what} {path} is not JSON: {error}") from None
    except RecursionError:
        raise InputError(f"{what} {path} cannot be read as JSON: it is nested too deeply") from None
    if kind is not None and not isinstance(content, kind):
        noun = "object" if kind is dict else "list"
        raise InputError(f"{what} {path} must be a JSON {noun}, not {type(content).__name__}")
    return content


def _whole(text: str) -> int:
    """Return an integer for a text; raise an error if it does not fit a float."""
    if len(text) > 308:
        raise ValueError(f"it contains a number of {len(text)} digits")
    return int(text)


MAX_UNPACKED = 2**30  # largest content of a compressed file; a few kilobytes can claim any number


def check_unpacked(archive: zipfile.ZipFile) -> None:
    """Check that an archive unpacks to at most ``MAX_UNPACKED`` bytes."""
    size = sum(member.file_size for member in archive.infolist())
    if size > MAX_UNPACKED:
        raise InputError(f"claims {size / 2**20:.0f} MiB of data, more than {MAX_UNPACKED // 2**20}, and is refused")


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]], compressed: bool = False) -> None:
    """Write an ``.npz`` archive atomically and reproducibly."""
    from numpy.lib.format import write_array

    with atomic_write(path) as file, zipfile.ZipFile(file, "w") as archive:
        for name, values in arrays.items():
            data = io.BytesIO()
            write_array(data, values, allow_pickle=False)
            member = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            member.compress_type = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
            archive.writestr(member, data.getvalue(), compresslevel=3)  # 6 takes three times as long


def read_arrays(path: Path, kind: str, remedy: str) -> dict[str, NDArray[Any]]:
    """Return the arrays of an ``.npz`` archive.

    Error messages contain the expected ``kind`` of file, such as "a weight file", and a ``remedy`` such as "train
    again". Raises InputError if the file cannot be read, is damaged, or claims too much.
    """
    from numpy.lib.format import read_array

    check_ends(path)
    try:
        with path.open("rb") as file:
            seekable = file if path.is_file() else io.BytesIO(file.read(MAX_UNPACKED))
            archive = zipfile.ZipFile(seekable)
            check_unpacked(archive)
            members = {name: io.BytesIO(archive.read(name)) for name in archive.namelist()}  # verifies the checksums
        return {name.removesuffix(".npy"): read_array(data, allow_pickle=False) for name, data in members.items()}
    except InputError as error:
        raise InputError(f"{path} {error}") from None
    except OSError as error:
        if error.strerror:
            raise InputError(f"cannot read {path}: {error.strerror}") from None
        raise InputError(f"{path} is damaged or not {kind}; {remedy}") from None
    except Exception:  # a damaged archive makes zipfile, zlib and NumPy raise almost any type
        raise InputError(f"{path} is damaged or not {kind}; {remedy}") from None


def plain(content: Any) -> Any:
    """Return content in which floats that JSON lacks, such as -inf, are strings."""
    if isinstance(content, dict):
        return {name: plain(value) for name, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [plain(value) for value in content]
    return str(content) if isinstance(content, float) and not math.isfinite(content) else content


def forget_stale_kernels(module: Path, steps: Iterable[Path]) -> None:
    """Remove cached Numba kernels of a module that are older than their sources.

    Numba looks only at the module with ``njit(cache=True)``, not at the sources of the functions that it calls.
    """
    newest = max(path.stat().st_mtime for path in steps)
    for kernel in (module.parent / "__pycache__").glob(f"{module.stem}.*.nb?"):
        with contextlib.suppress(OSError):  # a folder that cannot be written is no checkout
            if kernel.stat().st_mtime < newest:
                kernel.unlink()
