"""Common parts of the benchmarks: result file, spread of ratios, versions, processor time, and jobs in a simulator."""

from __future__ import annotations

import json
import os
import platform
import resource
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from eskin.base.errors import InputError
from eskin.base.files import origin, write_json
from eskin.base.outputs import check_file

if TYPE_CHECKING:
    from eskin.cocotb_tests.runner.simulator import Build

RESULTS = Path(__file__).parent / "results"

JOB = "ESKIN_BENCHMARK"
"""Environment variable with the job of a cocotb test as JSON."""

MEASURED = Path("measured.json")
"""File in which the test leaves its result, in its own folder."""


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


def in_simulator(program: Build, module: str, test: str, job: Any) -> Any:
    """Run a cocotb test of a benchmark, and return the content of its ``MEASURED``."""
    with tempfile.TemporaryDirectory() as folder:
        program.test(module, Path(folder), test, {JOB: json.dumps(job)})
        return json.loads((Path(folder) / MEASURED).read_text())


def timed(call: Callable[..., Any], *arguments: Any) -> tuple[Any, float]:
    """Return the result of a call, and its processor seconds."""
    start = time.process_time()
    found = call(*arguments)
    return found, time.process_time() - start


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
