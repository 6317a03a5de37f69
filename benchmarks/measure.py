"""Common parts of the benchmarks: result file, spread of ratios, versions, and processor time of other programs."""

from __future__ import annotations

import os
import platform
import resource
import statistics
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

import typer

from eskin.base.errors import InputError
from eskin.base.files import origin, write_json
from eskin.base.outputs import check_file

RESULTS = Path(__file__).parent / "results"


def _writable(path: Path | None) -> Path | None:
    """Return a path after checking that it is writable."""
    try:
        if path is not None:
            check_file(path)
    except InputError as error:
        raise typer.BadParameter(str(error)) from None
    return path


JsonFile = Annotated[Path | None, typer.Option("--json", callback=_writable, help="write the numbers to this file")]


def write(path: Path | None, name: str, options: str, content: dict[str, Any]) -> None:
    """Write a result with its command, commit and date, if the user named a file, and print the path."""
    if path is not None:
        said = {"benchmark": name, **origin(f"python benchmarks/{name}.py {options}".strip())}
        write_json(path, said | content)
        print(path)


def versions(*libraries: str) -> dict[str, Any]:
    """Return machine and versions of the measurement; None for a library that is not installed."""
    found: dict[str, Any] = {"python": platform.python_version()}
    for name in libraries:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = None
    return found | {"instruction_set": platform.machine(), "cpus": os.cpu_count()}


def spread(ratios: Sequence[float]) -> dict[str, float]:
    """Return the median, the smallest and the largest of several ratios."""
    return {"median": statistics.median(ratios), "least": min(ratios), "most": max(ratios)}


def children_s() -> float:
    """Return the processor seconds of all finished child processes."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@contextmanager
def measured(results: dict[str, Any], name: str) -> Iterator[None]:
    """Store the processor seconds of child processes in ``results``."""
    start = children_s()
    yield
    results[name] = round(children_s() - start, 2)
