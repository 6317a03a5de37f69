"""Find the cache folder for compiled kernels and recorded scans; it must belong to the user alone.

What lies there is run as code (a kernel) or believed (scans), so a folder that another user owns or can write to is
never used, and nor is a predictable place that any user could have made first, such as one under /tmp.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

CACHE_VARIABLE = "ESKIN_CACHE"
"""Environment variable that names another folder."""

_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
_NAME = "spiking-eskin-readout"


def folder() -> Path:
    """Return the path of the cache: ``$ESKIN_CACHE``, else a folder in ``$XDG_CACHE_HOME`` or ``~/.cache``."""
    if named := os.environ.get(CACHE_VARIABLE):
        return Path(named)
    return Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")) / _NAME


def usable(*parts: str) -> Path | None:
    """Return a folder in the cache, created if missing; None if it cannot be trusted or written."""
    place = folder()
    if str(place).startswith("~"):  # this user has no home
        return None
    for path in (place, place.joinpath(*parts)):
        try:
            path.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not path.is_symlink() and (mode := path.stat().st_mode) & _OTHERS_WRITE:
                path.chmod(stat.S_IMODE(mode) & ~_OTHERS_WRITE)  # fails where it is another user's
        except OSError:
            return None
        if not is_private(path) or not os.access(path, os.W_OK | os.X_OK):
            return None
    return place.joinpath(*parts)


def is_private(path: Path) -> bool:
    """Return whether a file or folder is not a link, belongs to this user, and no other user can change it."""
    try:
        found = path.lstat()
    except OSError:
        return False
    mine = not hasattr(os, "getuid") or found.st_uid == os.getuid()
    return mine and not stat.S_ISLNK(found.st_mode) and not found.st_mode & _OTHERS_WRITE
