"""Run OpenSTA."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from eskin.base.errors import InputError

PROGRAM = "sta"
NO_PROGRAM = "OpenSTA not found; install with: apt-get install opensta"


def check_program() -> None:
    """Check that OpenSTA is installed."""
    if shutil.which(PROGRAM) is None:
        raise InputError(NO_PROGRAM)


def run(script: str, folder: Path) -> tuple[str, int]:
    """Return the output of an OpenSTA script, and its exit status."""
    check_program()
    (folder / "script.tcl").write_text(f"{script}\nexit\n")
    command = [PROGRAM, "-no_init", "-no_splash", "-exit", "script.tcl"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return done.stdout + done.stderr, done.returncode
