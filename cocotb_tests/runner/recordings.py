"""Run a user's recordings through RTL and model, for ``sim --data`` and ``eskin.run_rtl``."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.files import make_folder
from eskin.base.progress import reported
from eskin.cocotb_tests.runner.chunk import job_of, play_here, until_it_lives
from eskin.cocotb_tests.runner.cocotb_runners import Simulator
from eskin.cocotb_tests.runner.inputs import Own
from eskin.cocotb_tests.runner.picture import PICTURE, draw
from eskin.cocotb_tests.runner.player import Job
from eskin.cocotb_tests.runner.process import Tally
from eskin.cocotb_tests.runner.reproduce import options
from eskin.cocotb_tests.runner.simulator import build, require_programs
from eskin.model.address_events import Events
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.recordings.quality import link_warning


@dataclass(frozen=True)
class OwnPlan:
    """The recordings to simulate."""

    material: Own  # the recordings, with the configuration that suits them
    names: list[str]  # names of the recordings to play
    simulator: Simulator
    waves: bool
    ticks: int | None  # largest number of samples of each recording
    out: Path

    @property
    def config(self) -> ReadoutConfig:
        """Configuration suitable for the recordings."""
        return self.material.recordings.config

    @property
    def picture(self) -> Path:
        """Path of the picture of the first recording."""
        return self.out / self.folder / PICTURE

    def warning(self) -> str:
        """Warning about link losses for the first recording; empty without losses."""
        return link_warning(self.config, self.material.arrays(self.names[:1])[self.names[0]][: self.ticks])

    @property
    def folder(self) -> str:
        """Name of the folder below ``out``."""
        config = self.config
        return f"{self.material.name}-{config.rows}x{config.columns}-{config.encoding}-{config.resolution}b"


def check(simulator: str, count: int, ticks: int | None) -> None:
    """Check the simulation parameters before recordings are read."""
    require_programs(simulator)  # type: ignore[arg-type]
    if count < 1 or (ticks is not None and ticks < 1):
        raise InputError(f"textures and ticks must be at least 1 with --data, not {count}, {ticks}")


def play(plan: OwnPlan, on_run: Callable[[Any], None]) -> Tally:
    """Simulate the recordings, store the RTL's events, and draw the first recording."""
    array = f"{plan.config.rows} x {plan.config.columns} taxels"
    with reported(f"building {array} for {plan.simulator}"):
        program = build(plan.config, plan.simulator, waves=plan.waves)
    codes = plan.material.arrays(plan.names)
    again = ["eskin sim", *options(plan.config), *plan.material.again, f"--ticks {plan.ticks or 10**6}"]
    job = dataclasses.replace(
        job_of(plan.material, plan.names, plan.config, program, " ".join(again)),
        ticks=plan.ticks,
        skip=plan.names[1:],
        keep=str(make_folder(plan.out, f"{plan.folder}/events").resolve()),
    )
    tally = play_here(program, job, codes, make_folder(plan.out, f"{plan.folder}/run", empty=True), on_run)
    draw(plan.config, plan.names[0], codes[plan.names[0]][: plan.ticks], plan.out / plan.folder)
    return tally


def play_samples(config: ReadoutConfig, codes: NDArray[np.int32], simulator: Simulator = "verilator") -> Events:
    """Return the RTL's events for codes, shape (ticks, taxels), after comparison with the model."""
    program, name = build(config, simulator), "signal"

    def play(folder: Path) -> Events:
        again = " ".join(["eskin sim", *options(config)])
        job = Job(config.to_dict(), again, played={name: {"proof": ""}}, keep=str(folder))
        play_here(program, job, {name: codes}, folder)
        return Recording.load(folder / f"{name}.npz").events

    events = until_it_lives(name, play)
    return events[events["t"] < len(codes) * config.clocks_per_sample]
