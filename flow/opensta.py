"""Runs OpenSTA."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from eskin.base.errors import InputError

PROGRAM = "sta"
NO_PROGRAM = "OpenSTA not found; install with: apt-get install opensta"


def check_program() -> None:
    """Refuse to go on without OpenSTA."""
    if shutil.which(PROGRAM) is None:
        raise InputError(NO_PROGRAM)


def run(script: str, folder: Path) -> tuple[str, int]:
    """Return the output of a script that runs in a folder, and its exit status, which is 0 after many errors.

    Raises
    ------
    InputError
        If the program is missing.
    """
    check_program()
    (folder / "script.tcl").write_text(f"{script}\nexit\n")
    command = [PROGRAM, "-no_init", "-no_splash", "-exit", "script.tcl"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return done.stdout + done.stderr, done.returncode
