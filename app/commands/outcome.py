"""What commands that make a folder of a run share: its name, and how they end."""

from __future__ import annotations

from pathlib import Path

import typer

from eskin.base.errors import InputError


def check_name(name: str) -> None:
    """Refuse the name of a run that would lead out of its folder."""
    if name != Path(name).name or name.startswith("."):
        raise InputError(f"--name must be the plain name of a folder, not {name!r}")


def conclude(problems: list[str], line: str) -> None:
    """Print the problems and the closing line; leave with 1 if there are any."""
    for problem in problems:
        print(f"PROBLEM: {problem}")
    print(line)
    if problems:
        raise typer.Exit(1)
