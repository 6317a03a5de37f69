"""What the command replay does: all scans of a dataset, those that are missing, side by side."""

from __future__ import annotations

import functools
import hashlib
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cocotb_tests.session.again import named, variables
from cocotb_tests.session.player import Job
from cocotb_tests.session.proof import proof
from cocotb_tests.session.session import MismatchFound, Tally, run_job
from cocotb_tests.session.simulator import Build, build, require_programs
from cocotb_tests.session.store import BUILD, scratch_folder
from model.config import ReadoutConfig
from model.errors import InputError
from model.events.recording import Recording
from model.files import make_folder
from model.textures.dataset import Dataset, Texture, open_dataset
from model.textures.presets import preset as scan_of


@dataclass(frozen=True)
class Plan:
    """What is to be played, and where the events go.

    Attributes
    ----------
    config : ReadoutConfig
        As the preset configures it.
    data : Dataset
    dataset : str or None
        Its place, as the user named it.
    preset : str
    start_row : float
    textures : list of Texture
    out : Path
        Folder for the folder of this replay.
    """

    config: ReadoutConfig
    data: Dataset
    dataset: str | None
    preset: str
    start_row: float
    textures: list[Texture]
    out: Path

    @property
    def array(self) -> str:
        """Name of the configuration for a person."""
        return f"{self.config.rows}x{self.config.columns}-{self.config.encoding}-{self.config.resolution}b"

    @property
    def place(self) -> str:
        """Name of the folder in ``out``."""
        origin = hashlib.sha256(f"{self.config.to_json()} {self.start_row}".encode()).hexdigest()[:6]
        return f"{self.data.name}-{self.preset}-{self.array}-{origin}"

    @property
    def folder(self) -> Path:
        """Folder of this replay."""
        return self.out / self.place

    @property
    def events(self) -> Path:
        """Folder of the event files."""
        return self.folder / "events"

    @functools.cached_property
    def program(self) -> Build:
        """The simulation program, built if need be."""
        return build(self.config, "verilator")

    @functools.cached_property
    def proofs(self) -> dict[str, str]:
        """What the recording of every texture shall carry."""
        return {texture.name: proof(self.program, texture, self.start_row) for texture in self.textures}

    def finished(self, texture: Texture) -> Recording | None:
        """Return the recording of a texture, if this very RTL, model and image made it."""
        try:
            found = Recording.load(self.events / f"{texture.name}.npz")
        except InputError:
            return None
        return found if found.metadata.get("proof") == self.proofs[texture.name] else None

    def job(self, textures: list[Texture]) -> Job:
        """Return the job that plays some of the textures."""
        again = [
            *variables(self.config),
            f"PRESET={self.preset}",
            f"START_ROW={self.start_row}",
            f"DATASET={self.dataset or self.data.name}",
        ]
        return Job(
            self.config.to_dict(),
            " ".join(["make replay", *again]),
            dataset=self.dataset,
            preset=self.preset,
            textures={texture.name: self.proofs[texture.name] for texture in textures},
            start_row=self.start_row,
            keep=str(self.events.resolve()),
        )


def plan(
    config: ReadoutConfig,
    dataset: str | None,
    preset: str,
    start_row: float,
    limit: int | None,
    only: str | None,
    out: Path,
) -> Plan:
    """Return the plan that a user asked for: all textures, ``limit`` of them, or ``only`` one by its name."""
    require_programs("verilator")
    data = open_dataset(dataset)
    textures = [named(data, only)] if only is not None else list(data.limit(limit) if limit is not None else data)
    config = scan_of(preset).configure(config, config.tau_s if config.encoding == "nlcs" else None)
    planned = Plan(config, data, dataset, preset, start_row, textures, out)
    make_folder(out, f"{planned.place}/events")
    return planned


def play(plan: Plan, missing: list[Texture], workers: int, on_run: Callable[[dict[str, Any]], None]) -> Tally:
    """Play textures in several simulations side by side; return what was compared.

    Raises
    ------
    MismatchFound
        If RTL and model differ; simulations that have not begun are left out.
    """
    stop = threading.Event()

    def work(part: int) -> Tally:
        mine = missing[part::workers]
        if not mine or stop.is_set():
            return Tally()
        with scratch_folder(BUILD / "run", "replay") as running:
            return run_job(plan.program, plan.job(mine), running, on_run)

    total = Tally()
    with ThreadPoolExecutor(workers) as pool:
        try:
            for tally in pool.map(work, range(workers)):
                total += tally
        except MismatchFound:
            stop.set()
            raise
    return total


def summarise(plan: Plan) -> dict[str, Any]:
    """Return what the recordings of all textures hold together; ``missing`` counts those that are not there."""
    found = [plan.finished(texture) for texture in plan.textures]
    clocks = sum(recording.duration_clocks for recording in found if recording)
    events = sum(len(recording.events) for recording in found if recording)
    return {
        "dataset": plan.data.name,
        "preset": plan.preset,
        "start_row": plan.start_row,
        "images": len(plan.textures),
        "clocks": clocks,
        "events": events,
        "mismatches": 0,
        "population_rate_hz": events / (clocks / plan.config.clock_hz) if clocks else 0.0,
        "missing": found.count(None),
    }
