"""Run OpenSTA."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from eskin.base.errors import InputError
from eskin.base.pages import templates

PROGRAM = "sta"
TEMPLATES = templates(Path(__file__).parent / "templates")
NO_PROGRAM = "OpenSTA not found; install with: apt-get install opensta"
SPEF = """*SPEF "IEEE 1481-1998"
*DESIGN "" *DATE "" *VENDOR "" *PROGRAM "" *VERSION "" *DESIGN_FLOW ""
*DIVIDER / *DELIMITER : *BUS_DELIMITER [ ]
*T_UNIT 1 NS *C_UNIT 1 PF *R_UNIT 1 OHM *L_UNIT 1 HENRY
"""


def check_program() -> None:
    """Check that OpenSTA is installed."""
    if shutil.which(PROGRAM) is None:
        raise InputError(NO_PROGRAM)


def run(script: str, folder: Path, files: Mapping[str, str | bytes] | None = None) -> tuple[str, int]:
    """Return the output of an OpenSTA script, and its exit status, after writing files into its folder."""
    check_program()
    for name, content in (files or {}).items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    (folder / "script.tcl").write_text(f"{script}\nexit\n")
    command = [PROGRAM, "-no_init", "-no_splash", "-exit", "script.tcl"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return done.stdout + done.stderr, done.returncode


def spef(nets: Iterable[tuple[str, float, Sequence[str]]]) -> str:
    """Return wire capacitances in SPEF format, without resistances.

    ``nets``: name, capacitance in pF, and ends of each net, the driver first: ``*I CELL:PIN I`` or ``*P PORT O``.
    """
    lines = [SPEF]
    for name, wire_pf, ends in nets:
        first, *others = (end.split()[1] for end in ends)
        lines += [f"*D_NET {name} {wire_pf:.6g}", "*CONN", *ends, "*CAP", f"1 {first} {wire_pf:.6g}", "*RES"]
        lines += [*(f"{i} {first} {other} 0.001" for i, other in enumerate(others, 1)), "*END"]
    return "\n".join([*lines, ""])
