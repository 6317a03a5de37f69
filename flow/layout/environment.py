"""Find and run the layout tools: Python packages in a separate environment, and KLayout."""

import os
import subprocess
from collections.abc import Mapping
from pathlib import Path

from eskin.base.errors import InputError
from eskin.flow import programs

ROOT = Path(__file__).resolve().parents[2]
VENV = ROOT / ".venv-layout"
PROGRAMS = Path(__file__).parent
REQUIREMENTS = PROGRAMS / "requirements.txt"

NO_PACKAGES = "the layout's packages are not there; `make layout` installs them (0.7 GB) in .venv-layout of a checkout"


class Crashed(RuntimeError):
    """Raised if a tool fails, with its last output line."""


def python() -> Path:
    """Return the path of the Python interpreter of the layout environment."""
    return VENV / "bin" / "python"


def check() -> None:
    """Check that all layout tools are installed."""
    if not (VENV / ".installed").is_file():
        raise InputError(NO_PACKAGES)
    programs.check("klayout")


def run(program: str, *words: str, folder: Path) -> None:
    """Run a program of this package in a working folder, and write its log there."""
    # For reproducible bytes: the generator iterates over sets, and the hash seed determines their order.
    _call([str(python()), "-sP", str(PROGRAMS / f"{program}.py"), *words], folder, program, {"PYTHONHASHSEED": "0"})


def klayout(deck: Path, variables: Mapping[str, str], folder: Path) -> None:
    """Run a KLayout script in batch mode."""
    home = {"QT_QPA_PLATFORM": "offscreen", "KLAYOUT_HOME": str((folder / "klayout").resolve())}
    _call(["klayout", "-zz", "-r", str(deck.resolve())], folder, deck.stem, home | dict(variables))


def _call(command: list[str], folder: Path, name: str, variables: Mapping[str, str]) -> None:
    log = folder / f"{name}.log"
    outer = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}  # its packages are others
    with log.open("w") as file:
        code = subprocess.run(
            command, cwd=folder, env=outer | dict(variables), stdout=file, stderr=subprocess.STDOUT, check=False
        ).returncode
    if code:
        last = (log.read_text(errors="replace").strip().splitlines() or ["no word"])[-1]
        raise Crashed(f"{name} ended with code {code}: {last.strip()[:200]}")
