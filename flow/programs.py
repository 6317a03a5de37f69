"""Run OpenSTA, Icarus and other system programs, and fill the templates of their inputs."""

import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from eskin.base.errors import InputError
from eskin.base.pages import templates
from eskin.flow.liberty.boolean import verilog_of

TEMPLATES = templates(Path(__file__).parent / "templates")
TEMPLATES.filters["verilog"] = lambda text: verilog_of(text) if text else "1'b0"

PACKAGES = {"sta": "OpenSTA", "iverilog": "iverilog", "klayout": "klayout"}
"""Names of the programs; in small letters, those of their packages."""


def filled(template: str, **values: Any) -> str:
    """Return a template of ``flow/templates`` with values."""
    return TEMPLATES.get_template(template).render(values)


def absent(program: str) -> str:
    """Return a sentence if a program is not installed, or an empty text."""
    name = PACKAGES[program]
    return "" if shutil.which(program) else f"{name} not found; install with: apt-get install {name.lower()}"


def check(*programs: str) -> None:
    """Raise InputError if a program is not installed."""
    for program in programs:
        if sentence := absent(program):
            raise InputError(sentence)


def call(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Run a program in a folder and return its output."""
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def icarus(texts: Sequence[str], top: str, folder: Path) -> str:
    """Return the output of a Verilog program, which runs in ``folder`` and leaves its files there."""
    check("iverilog")
    source = folder / "program.v"
    source.write_text("\n".join(texts))
    built = call(folder, "iverilog", "-g2005", "-s", top, "-o", "program.vvp", source.name)
    if built.returncode:
        reason = (built.stderr.strip().splitlines() or ["no word"])[0].removeprefix(f"{source.name}:")
        raise InputError(f"Icarus cannot read the netlist, line {reason}; give netlist, cells and options of one run")
    done = call(folder, "vvp", "-n", "program.vvp")
    if done.returncode:
        raise RuntimeError(f"the simulation failed: {done.stdout[-500:]}{done.stderr[-500:]}")
    return done.stdout


class ToolOutput(NamedTuple):
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


def opensta(script: str, files: Mapping[str, str | bytes], folder: Path | None = None) -> ToolOutput:
    """Run an OpenSTA script on files, in a folder or in a temporary one."""
    check("sta")
    if folder is None:
        with tempfile.TemporaryDirectory() as name:
            return opensta(script, files, Path(name))
    for name, content in files.items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    (folder / "script.tcl").write_text(f"{script}\nexit\n")
    done = call(folder, "sta", "-no_init", "-no_splash", "-exit", "script.tcl")
    return ToolOutput(done.stdout + done.stderr, done.returncode)
