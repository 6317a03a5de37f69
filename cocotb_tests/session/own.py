"""What ``sim --data`` does: a user's own recordings through RTL and model."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cocotb_tests.bench.stimuli import settled
from cocotb_tests.session.again import variables
from cocotb_tests.session.player import Job
from cocotb_tests.session.proof import proof_of
from cocotb_tests.session.runners import Simulator
from cocotb_tests.session.session import Tally, run_job
from cocotb_tests.session.simulator import build, require_programs
from model.config import ReadoutConfig
from model.errors import InputError
from model.events.recording import Recording
from model.figures.raster import plot_comparison
from model.files import atomic_write, make_folder
from model.readout import simulate
from model.recordings.folder import RecordingSet, read_set
from model.recordings.options import Preparation


@dataclass(frozen=True)
class OwnPlan:
    """Which recordings are played.

    Attributes
    ----------
    place : Path
        Folder of class folders, or a file.
    recordings : RecordingSet
        With the configuration that suits them.
    names : list of str
        Of those that are played.
    simulator : "verilator" or "icarus"
    waves : bool
    ticks : int or None
        Samples of each at most.
    out : Path
    """

    place: Path
    recordings: RecordingSet
    names: list[str]
    simulator: Simulator
    waves: bool
    ticks: int | None
    out: Path

    @property
    def config(self) -> ReadoutConfig:
        """The configuration that suits the recordings."""
        return self.recordings.config

    @property
    def folder(self) -> str:
        """Name of the folder in ``out``."""
        config = self.config
        return f"{self.recordings.name}-{config.rows}x{config.columns}-{config.encoding}-{config.resolution}b"


def plan(
    place: Path,
    config: ReadoutConfig,
    given: Collection[str],
    simulator: Simulator,
    waves: bool,
    count: int,
    ticks: int | None,
    out: Path,
) -> OwnPlan:
    """Return the plan for some recordings: ``count`` of them, one class after the other."""
    require_programs(simulator)
    if count < 1 or (ticks is not None and ticks < 1):
        raise InputError(f"textures and ticks must be at least 1 with --data, not {count}, {ticks}")
    if not place.exists():
        raise InputError(f"{place} does not exist; give a folder of class folders, or a recording")
    found = read_set(place, Preparation(baseline="first"), config, given)
    rank: dict[str | None, int] = {}
    order = []
    for source in found.sources:
        rank[source.class_name] = rank.get(source.class_name, -1) + 1
        order.append((rank[source.class_name], source.name))
    names = [name for _, name in sorted(order)[:count]]
    return OwnPlan(place, found, names, simulator, waves, ticks, out)


def play(plan: OwnPlan, on_run: Callable[[Any], None]) -> Tally:
    """Play the recordings of a plan, keep the RTL's events, and draw those of the first over the model's.

    Raises
    ------
    MismatchFound
        If RTL and model differ.
    """
    program = build(plan.config, plan.simulator, waves=plan.waves)
    numbers = {source.name: number for number, source in enumerate(plan.recordings.sources)}
    codes = {name: plan.recordings.codes[numbers[name]] for name in plan.names}
    running = make_folder(plan.out, f"{plan.folder}/run", empty=True)
    with atomic_write(running / "codes.npz") as file:
        np.savez_compressed(file, **codes)  # type: ignore[arg-type]
    again = ["make sim", *variables(plan.config), f"DATA={plan.place}", f"TICKS={plan.ticks or 10**6}"]
    job = Job(
        plan.config.to_dict(),
        " ".join(again),
        dataset=plan.recordings.name,
        textures={name: proof_of(program, hashlib.sha256(codes[name].tobytes()).hexdigest()) for name in plan.names},
        ticks=plan.ticks,
        codes=str((running / "codes.npz").resolve()),
        keep=str(make_folder(plan.out, f"{plan.folder}/events").resolve()),
    )
    tally = run_job(program, job, running, on_run)
    _picture(plan, codes[plan.names[0]][: plan.ticks])
    return tally


def _picture(plan: OwnPlan, samples: Any) -> None:
    """Draw the RTL's events of the first recording over the model's, and write the model's beside them."""
    name, folder, config = plan.names[0], plan.out / plan.folder, plan.config
    recorded = folder / "events" / f"{name}.npz"
    rtl = Recording.load(recorded)
    model = simulate(config, settled(config, samples))
    metadata = rtl.metadata | {"source": "model"}
    Recording(model, config, rtl.duration_clocks, metadata=metadata).save(folder / "model.npz")
    with atomic_write(folder / "rtl.npz") as file:
        file.write(recorded.read_bytes())
    plot_comparison(
        (rtl.events, model),
        config,
        folder / "raster.png",
        title=f"{name}, {config.encoding} {config.resolution} b, {config.rows} x {config.columns} taxels",
        signal=samples / config.full_scale,
        duration_clocks=rtl.duration_clocks,
    )
