"""Test that the session and the program in docs/guide/files.md give the printed output."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

DOCUMENT = Path(__file__).parents[2] / "docs" / "guide" / "files.md"


def blocks(language: str) -> list[str]:
    """Return the fenced code blocks of a language."""
    return re.findall(rf"```{language}\n(.*?)```", DOCUMENT.read_text(), re.DOTALL)


def steps(session: str) -> Iterator[tuple[str, str]]:
    """Return the commands of a session, each with its output."""
    for step in re.split(r"^\$ ", session, flags=re.MULTILINE)[1:]:
        command, _, output = step.partition("\n")
        yield command, output


def shape(text: str) -> str:
    """Return a text with every number replaced, because the last digits depend on libraries."""
    return re.sub(r"\d+(\.\d+)?(e\+\d+)?", "#", re.sub(" +", " ", text))


def test_the_session_and_the_program(tmp_path: Path) -> None:
    (session,) = blocks("console")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for command, shown in steps(session):
        line = re.sub("^python", sys.executable, command)
        done = subprocess.run(
            line, shell=True, cwd=tmp_path, env=os.environ | {"PATH": path}, capture_output=True, text=True
        )
        assert done.stderr == "", command
        assert done.returncode == (1 if "differ" in shown else 0), command
        told, cut, _ = shown.partition("...\n")
        if cut:
            assert shape(done.stdout).startswith(shape(told)), command
        else:
            assert shape(done.stdout) == shape(shown), command
    assert {"brick.npz", "rebuilt.npz", "rebuilt.png", "slow.npz", "both.png"} <= {
        file.name for file in tmp_path.iterdir()
    }

    (program,) = blocks("python")
    values: dict[str, np.ndarray] = {}
    exec(program.replace("brick.npz", str(tmp_path / "brick.npz")), values)
    assert len(values["time_s"]) > 1000
    assert values["time_s"].max() < 1.0
