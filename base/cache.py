"""Cache folder for compiled programs, kernels and recorded scans, private to the user.

Cache entries are executed (kernels, simulations) or trusted (scans). Therefore a folder that another user owns or can
write to is never used, nor a predictable path that any user could have created first, such as one under /tmp.
"""

import os
import stat
from pathlib import Path

from eskin.base.errors import InputError

CACHE_VARIABLE = "ESKIN_CACHE"  # environment variable that names another folder
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def folder() -> Path:
    """Return the path of the cache: ``$ESKIN_CACHE``, else a folder in ``$XDG_CACHE_HOME`` or ``~/.cache``."""
    if named := os.environ.get(CACHE_VARIABLE):
        return Path(named)
    return Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")) / "spiking-eskin-readout"


def usable(*parts: str) -> Path | None:
    """Return a folder in the cache, created if missing; None if the folder is unsafe or read-only."""
    place = folder()
    if str(place).startswith("~"):  # this user has no home
        return None
    whole = place.joinpath(*parts)
    return whole if _made_private(place) and _made_private(whole) else None


def private_folder(path: Path) -> Path:
    """Return a folder for executable code to which no other user can write, or raise InputError."""
    if not _made_private(path):
        raise InputError(
            f"{path} cannot be trusted with programs: it cannot be written, is a link, or other users own it or can "
            f"write to it; remove it, or set {CACHE_VARIABLE} to a folder of your own"
        )
    return path


def _made_private(path: Path) -> bool:
    """Create a folder if missing, forbid others to write to it; return True if it is private and writable."""
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not path.is_symlink() and (mode := path.stat().st_mode) & _OTHERS_WRITE:
            path.chmod(stat.S_IMODE(mode) & ~_OTHERS_WRITE)  # fails for a folder of another user
    except OSError:
        return False
    return is_private(path) and os.access(path, os.W_OK | os.X_OK)


def is_private(path: Path) -> bool:
    """Return True if a path is no link, belongs to this user, and cannot be changed by others."""
    try:
        found = path.lstat()
    except OSError:
        return False
    mine = not hasattr(os, "getuid") or found.st_uid == os.getuid()
    return mine and not stat.S_ISLNK(found.st_mode) and not found.st_mode & _OTHERS_WRITE
