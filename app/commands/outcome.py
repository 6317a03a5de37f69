"""Names and final messages of runs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from eskin.base.errors import InputError

if TYPE_CHECKING:
    from eskin.cocotb_tests.runner.process import Tally


def check_name(name: str) -> None:
    """Check that the name of a run does not lead out of its folder."""
    if name != Path(name).name or name.startswith("."):
        raise InputError(f"--name must be the plain name of a folder, not {name!r}")


@contextmanager
def failing_on(*errors: type[Exception], line: str = "") -> Iterator[None]:
    """Print an error of the given types and a further line, and exit with 1."""
    try:
        yield
    except errors as error:
        print(f"{error}\n{line}".rstrip("\n"))
        raise typer.Exit(1) from None


def conclude(problems: Iterable[str], line: str, mark: str = "PROBLEM: ", failed: bool = False) -> None:
    """Print problems and the last line; exit with 1 if problems exist or the run failed otherwise."""
    for problem in problems:
        failed = True
        print(f"{mark}{problem}")
    print(line)
    if failed:
        raise typer.Exit(1)


def make_line(target: str, **variables: object) -> str:
    """Return the make command that reproduces a result, without variables that are empty or False."""
    given = {name: 1 if value is True else value for name, value in variables.items() if value}
    return " ".join([f"make {target}", *(f"{name}={value}" for name, value in given.items())])


def bit_exact(total: Tally) -> str:
    """Return the final line of runs without mismatch; exit with 1 if no event was compared.

    Runs whose link is too slow for their signal end while requests wait, in the model as in the design.
    """
    if not total.events:
        print("FAILED: no event was compared")
        raise typer.Exit(1)
    if not total.drained:
        print(
            "no run came to rest: only sent events were compared, and requests still waited for the link at "
            "the end of every run"
        )
    return f"bit-exact: {total.runs} runs, {total.clocks} clocks, {total.events} events, 0 mismatches"
