"""Install the packages that a make target needs into the virtual environment, with uv.

Only the standard library is used here, since this runs before anything is installed.
"""

import contextlib
import fcntl
import hashlib
import json
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from eskin.app.uv import SetupError, build_of_torch, uv
from eskin.app.uv import install as install_packages

VENV = Path(".venv")
BASE = "base"
APART = {"layout": (Path(".venv-layout"), Path("flow/layout/requirements.txt"))}
"""Folder and pinned requirements of separate environments, for packages that conflict with the others."""

PROGRAMS = {"sim": ("g++", "make", "perl"), "layout": ("klayout",)}
"""System programs that a group or an environment needs."""

SIZES = {
    "base": 650,
    "sim": 40,
    "events": 75,
    "snn": 65,
    "files": 205,
    "asic": 30,
    "analog": 150,
    "board": 1,
    "fpga": 205,
    "fpga-small": 420,
    "lint": 16,
    "registers": 40,
    "dev": 250,
    "mutants": 30,
    "exchange": 50,
    "docs": 65,
}
"""Megabytes on disk of each group without PyTorch; a test measures them."""


def python(folder: Path = VENV) -> str:
    """Return the path of the Python interpreter of a virtual environment."""
    return str(folder / "bin" / "python")


def requirements(group: str) -> list[str]:
    """Return the requirements of an extra in pyproject.toml, or of the project itself for ``base``."""
    project = _project()
    return list(project["dependencies"] if group == BASE else project["optional-dependencies"][group])


def groups() -> list[str]:
    """Return the names of all extras."""
    return [BASE, *_project()["optional-dependencies"]]


def _project() -> dict[str, Any]:
    return dict(tomllib.loads(Path("pyproject.toml").read_text())["project"])


def missing(wanted: Iterable[str]) -> list[str]:
    """Return the extras with an installed state that differs from pyproject.toml and constraints.txt."""
    return [group for group in wanted if not _stamp(group).is_file() or _stamp(group).read_text() != _digest(group)]


def _stamp(group: str) -> Path:
    return VENV / f".installed-{group}"


def _digest(group: str) -> str:
    text = json.dumps([requirements(group), Path("constraints.txt").read_text()])
    return hashlib.sha256(text.encode()).hexdigest()


def install(wanted: Iterable[str]) -> None:
    """Install the project and extras; raise SetupError if a program is missing or uv fails."""
    wanted = list(wanted)
    _check_programs(wanted)
    if not missing(wanted):
        return
    with _lock(VENV):
        if not (todo := missing(wanted)):  # another make has just installed them
            return
        megabytes = sum(SIZES[group] for group in todo)
        print(f"setting up {VENV}, only once: {', '.join(todo)}, {megabytes} MB of pinned packages", flush=True)
        _make_environment(VENV)
        extras = [f"--extra={group}" for group in todo if group != BASE]
        command = [*uv(python()), "-c", "constraints.txt", "-r", "pyproject.toml", *extras, "-e", "."]
        install_packages([*command, *build_of_torch(command)])
        for group in todo:
            _stamp(group).write_text(_digest(group))


def install_apart(name: str) -> None:
    """Create a separate environment of ``APART``, and install its packages."""
    _check_programs([name])
    folder, pinned = APART[name]
    digest, stamp = hashlib.sha256(pinned.read_bytes()).hexdigest(), folder / ".installed"
    with _lock(folder):
        if stamp.is_file() and stamp.read_text() == digest:
            return
        print(f"setting up {folder}, only once: 700 MB of pinned packages", flush=True)
        _make_environment(folder)
        install_packages([*uv(python(folder)), "-r", str(pinned)])
        stamp.write_text(digest)


def _check_programs(wanted: list[str]) -> None:
    needed = [program for group in wanted for program in PROGRAMS.get(group, ()) if shutil.which(program) is None]
    if needed:
        raise SetupError(f"{', '.join(needed)} not found; install with: apt-get install {' '.join(needed)}")
    if not (find_spec("venv") and find_spec("ensurepip")):
        raise SetupError("Python has no venv; install with: apt-get install python3-venv")


def _make_environment(folder: Path) -> None:
    """Make a virtual environment, and let its pip install the pinned uv."""
    bring_uv = [
        python(folder),
        "-m",
        "pip",
        "install",
        "-q",
        "--disable-pip-version-check",
        "-c",
        "constraints.txt",
        "uv",
    ]
    for program, command in ("pip", [sys.executable, "-m", "venv", str(folder)]), ("uv", bring_uv):
        if not (folder / "bin" / program).exists() and subprocess.run(command, check=False).returncode:
            raise SetupError(f"{folder} could not be made; see the error above")


@contextlib.contextmanager
def _lock(folder: Path) -> Iterator[None]:
    """Lock a folder so that only one make at a time installs packages."""
    folder.mkdir(exist_ok=True)
    with open(folder / ".installing", "w") as file:  # uv itself locks .lock
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
