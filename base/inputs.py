"""Find the readable files in a user's folder."""

import os
import re
import stat
from collections.abc import Collection
from pathlib import Path

from eskin.base.errors import InputError
from eskin.base.units import counted

_KINDS = {stat.S_ISDIR: "a folder", stat.S_ISFIFO: "a FIFO", stat.S_ISSOCK: "a socket"}


def find_files(folder: Path, suffixes: Collection[str]) -> tuple[list[Path], list[str]]:
    """Return the files with given suffixes below a folder, and the paths with such names that are not files.

    Suffixes are in lower case. Links to folders are followed. Names that begin with a dot are left out. Files are in
    the order of their paths; each other path begins a sentence: ``a/x.csv is a FIFO``.
    """
    files, others, seen = list[Path](), list[str](), set[tuple[int, int]]()

    def unreadable(error: OSError) -> None:
        others.append(f"{error.filename} cannot be read ({error.strerror})")

    for place, folders, names in os.walk(folder, onerror=unreadable, followlinks=True):
        found = os.stat(place)
        if (found.st_dev, found.st_ino) in seen:  # a link to a folder above it
            folders.clear()
            continue
        seen.add((found.st_dev, found.st_ino))
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted([*folders, *names]):
            path = Path(place, name)
            if path.suffix.lower() in suffixes and not name.startswith("."):
                if what := not_a_file(path):
                    others.append(f"{path} is {what}")
                else:
                    files.append(path)
    return sorted(files), others


def check_no_others(folder: Path, paths: Collection[Path]) -> None:
    """Check that an output folder contains no .npz files except those that a command will write.

    Training on the folder would read the others too.
    """
    written = set(paths)
    if others := [path for path in find_files(folder, (".npz",))[0] if path not in written]:
        count = counted(len(others), ".npz file")
        named = f"{others[0]}{', ...' * (len(others) > 1)}"
        raise InputError(
            f"{folder} contains {count} that this command would not overwrite ({named}); choose another --out, or "
            f"remove the folder"
        )


def check_ends(path: Path) -> None:
    """Check that an input ends: a device and a named FIFO may not, the pipes of a shell do."""
    what = not_a_file(path)
    piped = re.match(r"/dev/(fd/|stdin$)|/proc/", str(path))
    if what in ("a FIFO", "a socket", "a device") and not piped:
        raise InputError(f"{path} is {what}; give a file")


def not_a_file(path: Path) -> str:
    """Return a description of a path that is not a file, such as "a FIFO"; empty for a file."""
    try:
        mode = path.stat().st_mode
    except OSError:
        return "a broken link" if path.is_symlink() else "nothing"
    if stat.S_ISREG(mode):
        return ""
    return next((noun for is_kind, noun in _KINDS.items() if is_kind(mode)), "a device")
