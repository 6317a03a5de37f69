"""Run OpenSTA."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

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


class Said(NamedTuple):
    """Output of an OpenSTA script."""

    text: str
    status: int  # exit status

    @property
    def values(self) -> dict[str, str]:
        """Texts that the script printed as ``HEADING <<TEXT>>``, by heading."""
        return dict(re.findall(r"^(\S[^<\n]*) <<(.*?)>>$", self.text, re.MULTILINE | re.DOTALL))

    def failed(self, pattern: str = "rror") -> str:
        """Return the first line with a pattern, or else the end of the output."""
        return next((line for line in self.text.splitlines() if re.search(pattern, line)), self.text[-300:])


def run(script: str, files: Mapping[str, str | bytes], folder: Path | None = None) -> Said:
    """Run an OpenSTA script on files, in a folder or in a temporary one."""
    check_program()
    if folder is None:
        with tempfile.TemporaryDirectory() as name:
            return run(script, files, Path(name))
    for name, content in files.items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    (folder / "script.tcl").write_text(f"{script}\nexit\n")
    command = [PROGRAM, "-no_init", "-no_splash", "-exit", "script.tcl"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return Said(done.stdout + done.stderr, done.returncode)


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
