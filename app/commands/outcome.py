"""Names and final messages of runs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from eskin.app.cli import asked_for, echo
from eskin.app.leave import EXIT_INTERRUPTED
from eskin.base.errors import InputError
from eskin.base.figures.files import write_results

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
        fail(f"{error}\n{line}".rstrip("\n"))


def fail(line: str) -> NoReturn:
    """Print the last line of a failed run, and exit with 1."""
    print(line)
    raise typer.Exit(1) from None


@contextmanager
def resumable(out: Path) -> Iterator[None]:
    """Print after Ctrl-C how to continue, and exit with 130."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"stopped; finished results are in {out}; run the same command again to continue", file=sys.stderr)
        raise typer.Exit(EXIT_INTERRUPTED) from None


def store(
    out: Path,
    name: str,
    data: dict[str, Any],
    plot: Callable[[dict[str, Any], Path], None],
    data_out: Path | None = None,
    quiet: bool = False,
) -> None:
    """Write results and their picture with the user's command, and print where they are, unless ``quiet``."""
    written = write_results(out, name, data, plot, data_out, command=asked_for())
    if not quiet:
        echo(written)


def conclude(problems: Iterable[str], line: str, mark: str = "PROBLEM: ", failed: bool = False) -> None:
    """Print problems and the last line; exit with 1 if problems exist or the run failed otherwise."""
    for problem in problems:
        failed = True
        print(f"{mark}{problem}")
    if failed:
        fail(line)
    print(line)


def make_line(target: str, **variables: object) -> str:
    """Return the make command that reproduces a result, without variables that are empty or False."""
    given = {name: 1 if value is True else value for name, value in variables.items() if value}
    return " ".join([f"make {target}", *(f"{name}={value}" for name, value in given.items())])


def bit_exact(total: Tally) -> str:
    """Return the final line of runs without mismatch; exit with 1 if no event was compared.

    Runs whose link is too slow for their signal end while requests wait, in the model as in the design.
    """
    if not total.events:
        fail("FAILED: no event was compared")
    if not total.drained:
        print(
            "no run came to rest: only sent events were compared, and requests still waited for the link at "
            "the end of every run"
        )
    return f"bit-exact: {total.runs} runs, {total.clocks} clocks, {total.events} events, 0 mismatches"
