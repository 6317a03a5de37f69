"""Run a Verilog program in the simulator Icarus."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from eskin.base.errors import InputError
from eskin.base.pages import templates
from eskin.flow.liberty.boolean import verilog_of

TEMPLATES = templates(Path(__file__).parents[1] / "templates")
"""Templates of the testbenches and of the cells."""
TEMPLATES.filters["verilog"] = lambda text: verilog_of(text) if text else "1'b0"

NO_PROGRAM = "iverilog not found; install with: apt-get install iverilog"


def run(texts: Sequence[str], top: str, folder: Path) -> str:
    """Return the output of a Verilog program, which runs in ``folder`` and leaves its files there."""
    if shutil.which("iverilog") is None:
        raise InputError(NO_PROGRAM)
    source, program = folder / "program.v", folder / "program.vvp"
    source.write_text("\n".join(texts))
    build = ["iverilog", "-g2005", "-s", top, "-o", str(program.resolve()), str(source.resolve())]
    built = subprocess.run(build, capture_output=True, text=True, check=False)
    if built.returncode:
        reason = (built.stderr.strip().splitlines() or ["no word"])[0].removeprefix(f"{source.resolve()}:")
        raise InputError(f"Icarus cannot read the netlist, line {reason}; give netlist, cells and options of one run")
    done = subprocess.run(
        ["vvp", "-n", str(program.resolve())], cwd=folder, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"the simulation failed: {done.stdout[-500:]}{done.stderr[-500:]}")
    return done.stdout
