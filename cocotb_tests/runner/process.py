"""Run a job in a simulator process, and follow its progress."""

from __future__ import annotations

import dataclasses
import json
import shutil
import threading
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eskin.base.errors import InputError
from eskin.base.files import refusing_a_full_disk
from eskin.cocotb_tests.bench.readout import Prepared, StimulusDriver
from eskin.cocotb_tests.runner.player import JOB, Job
from eskin.cocotb_tests.runner.simulator import Build
from eskin.model.config import ReadoutConfig

if TYPE_CHECKING:
    from eskin.model.readout import Stimulus

POLL_S = 0.2


@dataclass
class Tally:
    """Totals of a comparison."""

    # runs, their clocks and events
    runs: int = 0
    clocks: int = 0
    events: int = 0
    # runs that ended with nothing outstanding, and runs cut off while requests waited
    drained: int = 0
    cut: int = 0

    def __iadd__(self, other: Tally) -> Tally:
        for field in dataclasses.fields(self):
            setattr(self, field.name, getattr(self, field.name) + getattr(other, field.name))
        return self


class MismatchFound(Exception):  # the expected outcome for a faulty RTL, not a defect of this program
    """Raised if RTL and model differ, with the scoreboard's message.

    ``before`` has the runs of the same simulation that were equal.
    """

    def __init__(self, text: str, before: Tally | None = None) -> None:
        super().__init__(text)
        self.before = before or Tally()


def run_job(
    program: Build, job: Job, folder: Path, on_run: Callable[[dict[str, Any]], None] = lambda run: None
) -> Tally:
    """Run a job in a simulator and return the totals.

    Parameters
    ----------
    folder : Path
        Folder of the simulation and its log.
    on_run : callable, optional
        Called with each finished run: its name, clocks, events, outstanding.

    Raises
    ------
    MismatchFound
        If RTL and model differ.
    InputError
        If the job's textures or numbers are refused.
    AssertionError
        If the simulation failed for another reason; the text is the end of its log.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with refusing_a_full_disk(folder):
        if job.seed is not None:
            job = dataclasses.replace(job, scenarios=_scenarios(job, folder / "scenarios"))
        try:
            return follow(program, "eskin.cocotb_tests.runner.player", job, folder, on_run)
        finally:
            shutil.rmtree(folder / "scenarios", ignore_errors=True)


def follow(
    program: Build,
    module: str,
    job: Job,
    folder: Path,
    on_run: Callable[[dict[str, Any]], None] = lambda run: None,
) -> Tally:
    """Start the cocotb test ``module`` with a job in a folder, report each finished run, and return the totals."""
    progress, mismatch, refused = folder / "progress.jsonl", folder / "mismatch.txt", folder / "refused.txt"
    for old in (progress, mismatch, refused):
        old.unlink(missing_ok=True)
    path = (folder / "job.json").resolve()
    path.write_text(json.dumps(asdict(job)))
    failure: list[BaseException] = []

    def simulate() -> None:
        try:
            program.test(module, folder, "play", {JOB: str(path)})
        except BaseException as error:
            failure.append(error)

    thread = threading.Thread(target=simulate, daemon=True)
    thread.start()
    tally = Tally()
    position = 0
    while True:
        alive = thread.is_alive()
        if progress.exists():
            with progress.open() as file:
                file.seek(position)
                while (line := file.readline()).endswith("\n"):
                    position = file.tell()
                    run = json.loads(line)
                    drained = not run.get("outstanding")
                    tally += Tally(1, run["clocks"], run["events"], int(drained), int(not drained))
                    on_run(run)
        if not alive:
            break
        thread.join(POLL_S)
    if mismatch.exists():
        raise MismatchFound(mismatch.read_text(), tally)
    if refused.exists():
        raise InputError(refused.read_text())
    if failure:
        raise failure[0]
    return tally


def _scenarios(job: Job, folder: Path) -> list[dict[str, Any]]:
    """Prepare the scenarios of a job in a folder."""
    from eskin.cocotb_tests.bench.stimuli import scenarios

    assert job.seed is not None
    config = ReadoutConfig.from_dict(job.config)
    return [
        prepare(config, one.name, one.stimulus, folder / str(number), outstanding=one.outstanding)
        for number, one in enumerate(scenarios(config, job.seed))
    ]


def prepare(config: ReadoutConfig, name: str, stimulus: Stimulus, place: Path, **own: Any) -> dict[str, Any]:
    """Write stimulus and expected events of a run into a folder; return its description for a job."""
    from eskin.model.readout import simulate

    place = place.resolve()
    place.mkdir(parents=True, exist_ok=True)
    StimulusDriver(config, place).write(stimulus)
    np.save(place / "expected.npy", simulate(config, stimulus))
    return asdict(Prepared(name, stimulus.clocks, folder=str(place), **own))
