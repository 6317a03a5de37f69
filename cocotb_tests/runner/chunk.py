"""Simulate a part of the inputs as one task of a worker pool."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.files import atomic_write, make_folder
from eskin.base.workers.pool import MOST_DEATHS
from eskin.cocotb_tests.runner.build_cache import BUILD, scratch_folder
from eskin.cocotb_tests.runner.inputs import Material
from eskin.cocotb_tests.runner.player import Job
from eskin.cocotb_tests.runner.process import Tally, run_job
from eskin.cocotb_tests.runner.simulator import Build, SimulationDied, build
from eskin.model.config import ReadoutConfig

T = TypeVar("T")


def job_of(material: Material, names: Sequence[str], config: ReadoutConfig, program: Build, again: str) -> Job:
    """Return the job for a part of the inputs; ``again`` is the command that repeats a mismatch."""
    said = material.said(names)
    return Job(
        config.to_dict(),
        again,
        dataset=material.name,
        preset=material.preset,
        start_row=material.start_row,
        played={name: said[name] | {"proof": material.proof(name, program)} for name in names},
    )


def play_here(
    program: Build,
    job: Job,
    arrays: dict[str, NDArray[Any]],
    folder: Path,
    on_run: Callable[[dict[str, Any]], None] = lambda run: None,
) -> Tally:
    """Run a job in a folder, and return the totals."""
    arrays_at = write_arrays(folder, arrays)
    return run_job(program, dataclasses.replace(job, arrays=str(arrays_at.resolve())), folder, on_run)


def write_arrays(folder: Path, arrays: dict[str, NDArray[Any]]) -> Path:
    """Write the images or samples of a job into its folder, and return the file."""
    path = folder / "arrays.npz"
    with atomic_write(path) as file:
        np.savez(file, **{f"array/{name}": array for name, array in arrays.items()})  # type: ignore[arg-type]
    return path


def play_part(job: Job, arrays: dict[str, NDArray[Any]]) -> tuple[Tally, dict[str, bytes]]:
    """Run a job on this machine and return totals and event files; restart a crashed simulation."""
    program = build(ReadoutConfig.from_dict(job.config), "verilator")

    def play(running: Path) -> tuple[Tally, dict[str, bytes]]:
        events = running / "events"
        tally = play_here(program, dataclasses.replace(job, keep=str(events.resolve())), arrays, running)
        return tally, {name: (events / f"{name}.npz").read_bytes() for name in job.played}

    return until_it_lives("replay", play)


def store(folder: Path, files: dict[str, bytes], on_run: Callable[[], object]) -> None:
    """Write result files into a folder, each file whole or not at all."""
    for name, content in files.items():
        make_folder(folder, Path(name).parent)
        with atomic_write(folder / f"{name}.npz") as file:
            file.write(content)
        on_run()


def until_it_lives(name: str, play: Callable[[Path], T]) -> T:
    """Return the result of a simulation, restarted in a new folder after a crash."""
    for _ in range(MOST_DEATHS + 1):
        with scratch_folder(BUILD / "run", name) as running:
            try:
                return play(running)
            except SimulationDied as died:
                last = str(died).strip().splitlines()[-1]
    raise InputError(
        f"the simulation crashed {MOST_DEATHS + 1} times, perhaps from lack of memory ({last}); use fewer --workers"
    )
