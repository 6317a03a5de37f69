"""Fixtures of the command-line tests."""

import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import cast

import pytest
import typer
from hypothesis import settings

from eskin.app import make
from eskin.app.catalogue import COMMANDS
from eskin.app.cli import Command, Commands, app, run
from eskin.base import progress

Call = Callable[..., tuple[int, str, str]]

# Tests run side by side, one process a core: threads of theirs would wait for each other, at twice the time in all.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# A busy machine, or Numba compiling in the first example, is no failure.
settings.register_profile("no deadline", deadline=None)
settings.load_profile("no deadline")


@pytest.fixture(autouse=True, scope="session")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Set a cache folder for tests, shared by all workers of a run."""
    run = tmp_path_factory.getbasetemp()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ESKIN_CACHE", str((run.parent if "PYTEST_XDIST_WORKER" in os.environ else run) / "cache"))
        yield


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty folder, set as current folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def shorten(patch: pytest.MonkeyPatch) -> None:
    """Shorten the trainings that choose settings for recordings, and the training without ``--epochs``."""
    from eskin.snn import encoder_choice
    from eskin.snn.experiments import inner, recipes

    patch.setattr(encoder_choice, "UPDATES", (30, 10, 10, 30))
    for module in (encoder_choice, inner):
        patch.setattr(module, "FEW", 0)
    patch.setattr(recipes, "UPDATES", 300)


@pytest.fixture
def shorter(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shorten trainings by ``shorten``."""
    shorten(monkeypatch)


def run_eskin(*arguments: object, program: typer.Typer = app) -> subprocess.CompletedProcess[str]:
    """Run ``eskin`` or another program in this process, and return exit code, output and error output."""
    words = [str(argument) for argument in arguments]
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), pytest.raises(SystemExit) as left:
        run(program, "eskin" if program is app else "test", words)
    assert isinstance(left.value.code, int)
    return subprocess.CompletedProcess(words, left.value.code, out.getvalue(), err.getvalue())


def without_numbers(text: str) -> str:
    """Return a text with every number replaced, because the last digits depend on libraries."""
    return re.sub(r"\d+(\.\d+)?(e\+\d+)?", "#", re.sub(" +", " ", text))


@cache
def command(name: str) -> Command:
    """Return a command of ``eskin``."""
    return cast(Command, Commands(COMMANDS)[name])


@pytest.fixture
def call(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Call:
    """Return a function that runs ``eskin`` in the folder and returns exit code, standard output and standard error.

    The function takes a command line, or its words; it splits each word at blanks. A slow machine prints no lines about
    progress, so that tests can compare standard error.
    """
    monkeypatch.setattr(progress, "SILENCE_S", 600.0)

    def call(*words: object) -> tuple[int, str, str]:
        done = run_eskin(*(part for word in words for part in str(word).split()))
        return done.returncode, done.stdout, done.stderr

    return call


@pytest.fixture
def dry_make(monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[object, list[list[str]], str]]:
    """Return a function that makes a target as a dry run, and returns exit code, its command lines and errors."""

    def dry_make(target: str, *variables: str) -> tuple[object, list[list[str]], str]:
        quoted = [re.sub(r"([\\ ])", r"\\\1", word).replace("$", "$$") for word in variables]
        monkeypatch.setenv("MAKEFLAGS", f"n -- {' '.join(quoted)}")
        monkeypatch.setattr(sys, "argv", ["make", target, make.INSIDE])
        out, err, code = io.StringIO(), io.StringIO(), None
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                make.main()
            except SystemExit as left:
                code = left.code
        lines = [shlex.split(line) for line in out.getvalue().splitlines() if line.startswith(".venv/")]
        return code or 0, lines, err.getvalue()

    return dry_make


@pytest.fixture
def refuses(call: Call, folder: Path) -> Callable[..., None]:
    """Return a function that checks that ``eskin`` refuses a command line in one sentence and leaves nothing new.

    ``sentence`` is a part of the error message; with ``error: `` and a line end it is all of it.
    """

    def files() -> dict[Path, bytes | None]:
        return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}

    def refuses(sentence: str, *words: object) -> None:
        before = files()
        code, out, error = call(*words)
        assert (code, out) == (2, "")
        assert error.startswith("error: ")
        assert error.count("\n") == 1
        assert sentence in error
        assert files() == before

    return refuses
