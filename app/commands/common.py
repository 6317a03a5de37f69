"""What several commands share: options, and the names, files and final messages of runs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from eskin.app.cli import asked_for, echo
from eskin.app.leave import EXIT_INTERRUPTED
from eskin.app.options import LEAKY, opt, out_folder
from eskin.base.errors import InputError
from eskin.base.files import origin, write_json
from eskin.skin.textures.rates import PAPER_TAU_S

if TYPE_CHECKING:
    from eskin.cocotb_tests.runner.process import Tally

Plot = Callable[[dict[str, Any], Path], None]
DEFAULT_OUT = Path("out")
Out = Annotated[Path, out_folder(..., "DIR", "folder for data and picture")]
Settings = Annotated[list[str] | None, opt(..., "--set", "NAME=NUMBER", "change a parameter, repeatable")]
Synthesis = Annotated[
    list[Path] | None, opt(..., "FILE", "synthesis report (JSON) of a readout's digital part, repeatable")
]
Dataset = Annotated[str | None, opt(..., "DIR|embedded", "measure event rates on these textures [stored rates]")]
Textures = Annotated[str | None, opt(..., "DIR|embedded", "textures [$ESKIN_DATA, data/kylberg, else embedded]")]
Scan = Annotated[str, opt(..., "--preset", "paper|physical", "constants of the texture scan")]
Limit = Annotated[int | None, opt(..., "K", "number of images, evenly spread [all]")]
Tau = Annotated[float | None, opt(..., "SECONDS", f"{', '.join(LEAKY)}: time constant [{PAPER_TAU_S}]")]
Preset = Annotated[str, opt(..., "--preset", "paper|physical", "texture scan of the event rates")]
Rates = Annotated[Path | None, opt(..., "--rates", "FILE", "event rates, from studies/event_rates.py")]
Json = Annotated[bool, opt(..., "--json", "print one JSON object")]
Workers = Annotated[int | None, opt(..., "N", "parallel processes on this machine [one per usable core]")]
Scheduler = Annotated[str | None, opt(..., "ADDRESS", "Dask scheduler, tcp://HOST:8786, instead of this machine")]


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


def write_results(
    out: Path, name: str, data: dict[str, Any], plot: Plot, data_out: Path | None = None, command: str = ""
) -> str:
    """Write the data to ``name``.json and their picture to ``name``.png; return a sentence on the written files.

    Missing folders are made. The data begin with the command (by default as typed), commit and date.
    """
    data_out = data_out or out
    for folder in (out, data_out):
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot make the folder {folder}: {error.strerror}; choose another --out") from None
    write_json(data_out / f"{name}.json", origin(command or asked_for()) | data)
    plot(data, out / f"{name}.png")
    return f"wrote {data_out / name}.json and {out / name}.png"


def store(
    out: Path, name: str, data: dict[str, Any], plot: Plot, data_out: Path | None = None, quiet: bool = False
) -> None:
    """Write results and their picture, and print where they are, unless ``quiet``."""
    written = write_results(out, name, data, plot, data_out)
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


def early_text(answer: Mapping[str, Any]) -> str:
    """Return the early decision of an answer as text; empty for a network without a margin."""
    if "early" not in answer:
        return ""
    if answer["early"] is None:
        return ", no early decision"
    return f", early decision: {answer['early']} after {answer['early_s']:.3g} s"


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
