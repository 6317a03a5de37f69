"""Play runs in a simulator process, and compare each of them with its model."""

from __future__ import annotations

import dataclasses
import json
import shutil
import threading
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from eskin.base.files import make_folder, refusing_a_full_disk
from eskin.cocotb_tests.bench.host import Host
from eskin.cocotb_tests.bench.readout import Mismatch, Outcome, compare, compare_miso, write_stimulus
from eskin.cocotb_tests.bench.stimuli import outstanding, scenarios
from eskin.cocotb_tests.runner.player import END, OUTCOME, POLL_S, RUN, write_whole
from eskin.cocotb_tests.runner.simulator import Build, SimulationDied
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.model.readout import Stimulus

AHEAD = 2
"""Runs that are prepared while the simulator plays another."""


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
        for one in dataclasses.fields(self):
            setattr(self, one.name, getattr(self, one.name) + getattr(other, one.name))
        return self


class MismatchFound(Exception):  # the expected outcome for a faulty RTL, not a defect of this program
    """Raised if RTL and model differ, with the description of the first difference.

    ``before`` has the runs of the same simulation that were equal.
    """

    def __init__(self, text: str, before: Tally | None = None) -> None:
        super().__init__(text)
        self.before = before or Tally()


class Run(Protocol):
    """A run of the harness."""

    @property
    def skip(self) -> bool:
        """Whether the harness may skip the clocks in which nothing is awake."""

    def write(self, folder: Path) -> None:
        """Write the files that the harness plays."""

    def report(self, folder: Path, outcome: Outcome) -> dict[str, Any]:
        """Compare what the harness recorded with the model; return name, clocks, events and outstanding requests.

        Raise Mismatch if they differ.
        """


@dataclass(frozen=True)
class ReadoutRun:
    """A run of a readout."""

    config: ReadoutConfig
    name: str
    stimulus: Stimulus
    reproduce: str  # command that repeats it
    skips: bool = False  # may skip clocks, if the sink is always ready
    needs_events: bool = False  # a run without events is a mismatch
    keep: Path | None = None  # file for the RTL's events
    metadata: dict[str, Any] = field(default_factory=dict)  # of this file
    host: Host | None = None  # what sets the registers meanwhile

    @property
    def skip(self) -> bool:
        return self.skips and bool(self.stimulus.ready.all())

    def write(self, folder: Path) -> None:
        write_stimulus(self.config, folder, self.stimulus, host=self.host)

    def report(self, folder: Path, outcome: Outcome) -> dict[str, Any]:
        seen = self.host.run.stimulus if self.host else self.stimulus
        events = compare(self.config, self.name, seen, folder, outcome, self.reproduce)
        if self.host:
            compare_miso(self.host, self.name, folder, self.reproduce)
        if self.needs_events and not len(events):
            raise Mismatch(f"{self.name}: there was no event, so nothing was compared; reproduce: {self.reproduce}")
        if self.keep is not None:
            Recording(events, self.config, self.stimulus.clocks, metadata=self.metadata).save(self.keep)
        covered = {"covered": self.host.describe(self.config)} if self.host else {}
        waiting = outstanding(self.config, seen)
        return {"name": self.name, "clocks": seen.clocks, "events": len(events), "outstanding": waiting} | covered


def scenario_runs(config: ReadoutConfig, seed: int, reproduce: str) -> Iterable[ReadoutRun]:
    """Yield the runs of all scenarios of a seed."""
    for one in scenarios(config, seed):
        yield ReadoutRun(config, one.name, one.stimulus, reproduce, needs_events=True, host=one.host)


def play_runs(
    program: Build, runs: Iterable[Run], folder: Path, on_run: Callable[[dict[str, Any]], None] = lambda run: None
) -> Tally:
    """Play runs in a simulator, compare each with its model, and return the totals.

    Parameters
    ----------
    folder : Path
        Folder of the simulation and its log.
    on_run : callable, optional
        Called with the report of each finished run.

    Raises
    ------
    MismatchFound
        If RTL and model differ; the text is also in ``mismatch.txt``.
    AssertionError
        If the simulation failed for another reason; the text is the end of its log.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / END).unlink(missing_ok=True)
    (folder / "mismatch.txt").unlink(missing_ok=True)
    with refusing_a_full_disk(folder):
        simulation = _Simulation(program, folder)
        tally = Tally()
        waiting: deque[tuple[Run, Path]] = deque()

        def finish() -> None:
            nonlocal tally
            run, place = waiting[0]
            report = run.report(place, simulation.outcome(place))
            waiting.popleft()
            shutil.rmtree(place)
            drained = not report.get("outstanding")
            tally += Tally(1, report["clocks"], report["events"], int(drained), int(not drained))
            on_run(report)

        try:
            for number, run in enumerate(runs):
                place = make_folder(folder, str(number), empty=True)
                run.write(place)
                write_whole(place / RUN, {"skip": run.skip})
                waiting.append((run, place))
                if len(waiting) > AHEAD:
                    finish()
            while waiting:
                finish()
        except Mismatch as mismatch:
            (folder / "mismatch.txt").write_text(str(mismatch))
            raise MismatchFound(str(mismatch), tally) from None
        finally:
            for _, place in waiting:
                shutil.rmtree(place, ignore_errors=True)
            (folder / END).touch()
            simulation.thread.join()
        simulation.check()
        return tally


class _Simulation:
    """A simulator process that plays the runs in a folder."""

    def __init__(self, program: Build, folder: Path) -> None:
        self.failure: BaseException | None = None

        def simulate() -> None:
            try:
                program.test("eskin.cocotb_tests.runner.player", folder, "play")
            except BaseException as error:
                self.failure = error

        self.thread = threading.Thread(target=simulate, daemon=True)
        self.thread.start()

    def outcome(self, place: Path) -> Outcome:
        """Wait for the outcome of the run in a folder."""
        path = place / OUTCOME
        while not path.exists():
            if not self.thread.is_alive() and not path.exists():
                self.check()
                raise SimulationDied("the simulation ended before its last run")
            self.thread.join(POLL_S)
        return Outcome(**json.loads(path.read_text()))

    def check(self) -> None:
        """Raise the exception with which the simulation ended, if any."""
        if self.failure is not None:
            raise self.failure
