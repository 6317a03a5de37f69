"""How a command with checks ends."""

from __future__ import annotations

import typer


def conclude(problems: list[str], line: str) -> None:
    """Print the problems and the closing line; leave with 1 if there are any."""
    for problem in problems:
        print(f"PROBLEM: {problem}")
    print(line)
    if problems:
        raise typer.Exit(1)
