"""Cache of Verilog texts and simulation programs in ``build/``, keyed by a digest of their inputs."""

import contextlib
import fcntl
import hashlib
import importlib.metadata
import os
import shutil
import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from eskin import model, rtl
from eskin.base import cache
from eskin.base.files import atomic_write, digest
from eskin.rtl import yosys
from eskin.rtl.verilog import Config, verilog

ROOT = Path(__file__).resolve().parents[2]
BUILD = (ROOT if (ROOT / "pyproject.toml").is_file() else cache.folder()) / "build"
"""In the checkout; in the user's cache where the packages are installed without one. What lies there is run."""
MAX_BYTES = 2**30
"""Size limit of ``build/sim``, and of ``build/verilog``."""
KEPT_S = 3600


def sources(places: Iterable[tuple[Any, str]]) -> str:
    """Return a digest of source files.

    Each place is a package and a pattern of files in it.
    """
    read = hashlib.sha256()
    for package, pattern in places:
        folder = Path(str(package.__file__)).parent
        files = sorted(folder.glob(pattern))
        assert files, f"no sources {pattern} in {folder}"
        for path in files:
            read.update(f"{path.relative_to(folder.parent)}\0".encode() + path.read_bytes() + b"\0")
    return read.hexdigest()


def versions(*packages: str) -> dict[str, str]:
    """Return the versions of installed packages."""
    return {name: importlib.metadata.version(name) for name in packages}


# Computed at import, because later edits of the sources do not change the running code.
_VERILOG_IS_MADE_OF = [
    sources(((rtl, "**/*.py"), (model, "**/*.py"))),
    versions("amaranth", yosys.PACKAGE),
]


SOURCES = digest(_VERILOG_IS_MADE_OF)
"""Digest of all sources that determine the Verilog."""


def verilog_text(config: Config) -> str:
    """Return the Verilog of a configuration, from the cache if possible.

    A text is stored with its digest, so that a damaged text is generated again. It is written atomically, so that two
    processes may generate the same text.
    """
    key = digest([type(config).__name__, config.to_dict(), _VERILOG_IS_MADE_OF])
    path = BUILD / "verilog" / f"{key}.v"
    cache.private_folder(path.parent)
    with contextlib.suppress(OSError, UnicodeDecodeError):
        stamp, _, text = path.read_text().partition("\n")
        if stamp == _stamp(text):
            path.touch()
            return text
    text = verilog(config)
    with atomic_write(path) as file:
        file.write(f"{_stamp(text)}\n{text}".encode())
    trim(path.parent)
    return text


def _stamp(text: str) -> str:
    return f"// sha256 {hashlib.sha256(text.encode()).hexdigest()}"


@contextlib.contextmanager
def locked(path: Path, flags: int = os.O_RDONLY, wait: bool = True) -> Iterator[None]:
    """Lock a file or folder; without ``wait``, raise BlockingIOError if another process holds the lock."""
    handle = os.open(path, flags)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        yield
    finally:
        os.close(handle)


@contextlib.contextmanager
def scratch_folder(parent: Path, name: str) -> Iterator[Path]:
    """Create a temporary folder for this process, and remove the folders of killed processes.

    All folders in ``parent`` whose names begin with a dot are such folders; ``name`` is a note for people who find
    them.
    """
    cache.private_folder(parent)
    with contextlib.ExitStack() as mine:
        with locked(parent):  # otherwise another process could find the folder before the lock
            for left in parent.glob(".*/"):
                with contextlib.suppress(OSError), locked(left, os.O_RDONLY | os.O_NOFOLLOW, wait=False):
                    shutil.rmtree(left, ignore_errors=True)  # no living process holds it
            folder = Path(tempfile.mkdtemp(prefix=f".{name}.", dir=parent))
            mine.enter_context(locked(folder))
        mine.callback(shutil.rmtree, folder, ignore_errors=True)
        yield folder


def trim(folder: Path, limit: int = MAX_BYTES) -> None:
    """Remove the least recently used entries of a cache folder until its size limit is met.

    Entries used within the last hour stay. The time of use is that of a file, or of the file ``built`` in a folder.
    """
    used = []
    for entry in folder.glob("[!.]*"):
        with contextlib.suppress(OSError):  # another process trims
            files = [entry, *entry.iterdir()] if entry.is_dir() else [entry]
            mark = entry / "built" if entry.is_dir() else entry
            used.append((mark.stat().st_mtime, sum(file.lstat().st_size for file in files), entry))
    total = 0
    for time_of_use, size, entry in sorted(used, reverse=True):
        total += size
        if total > limit and time_of_use < time.time() - KEPT_S:
            if entry.is_dir():
                shutil.rmtree(entry, ignore_errors=True)
            else:
                entry.unlink(missing_ok=True)
