"""Runs a job in a simulator from outside, and follows it."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cocotb_tests.player import JOB, Job
from cocotb_tests.simulator import Build

POLL_S = 0.2


class MismatchFound(Exception):  # the outcome that is looked for, not a defect of the program
    """RTL and model differ; the text is the scoreboard's."""


@dataclass
class Tally:
    """What has been compared.

    Attributes
    ----------
    runs, clocks, events, drained : int
        Runs, their clocks and events, and how many ended with nothing outstanding.
    """

    runs: int = 0
    clocks: int = 0
    events: int = 0
    drained: int = 0

    def add(self, line: dict[str, Any]) -> None:
        """Count a run."""
        self.runs += 1
        self.clocks += line["clocks"]
        self.events += line["events"]
        self.drained += line["drained"]

    def __iadd__(self, other: Tally) -> Tally:
        self.runs += other.runs
        self.clocks += other.clocks
        self.events += other.events
        self.drained += other.drained
        return self


def run_job(program: Build, job: Job, folder: Path, on_run: Callable[[dict[str, Any]], None] | None = None) -> Tally:
    """Play a job in a simulator and return what was compared.

    Parameters
    ----------
    program : Build
    job : Job
    folder : Path
        Where the simulation runs and leaves its log.
    on_run : callable, optional
        Called with each finished run: its name, clocks, events, drained.

    Raises
    ------
    MismatchFound
        If RTL and model differ.
    AssertionError
        If the simulation failed for another reason; the text is the end of its log.
    """
    folder.mkdir(parents=True, exist_ok=True)
    progress, mismatch = folder / "progress.jsonl", folder / "mismatch.txt"
    for old in (progress, mismatch):
        old.unlink(missing_ok=True)
    job.write(folder / "job.json")

    failure: list[BaseException] = []

    def simulate() -> None:
        try:
            program.test("cocotb_tests.player", folder, "play", {JOB: str((folder / "job.json").resolve())})
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
                    tally.add(json.loads(line))
                    if on_run:
                        on_run(json.loads(line))
        if not alive:
            break
        time.sleep(POLL_S)
    if mismatch.exists():
        raise MismatchFound(mismatch.read_text())
    if failure:
        raise failure[0]
    return tally
