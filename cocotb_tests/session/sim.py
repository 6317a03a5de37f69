"""What the command sim does: scenarios and texture scans of one configuration after the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cocotb_tests.bench.stimuli import STIMULI, settled
from cocotb_tests.bench.textures import large_enough
from cocotb_tests.session.again import named, reproduce
from cocotb_tests.session.player import Job
from cocotb_tests.session.proof import proof
from cocotb_tests.session.runners import Simulator
from cocotb_tests.session.session import Tally, run_job
from cocotb_tests.session.simulator import build, require_programs
from model.config import ReadoutConfig
from model.errors import InputError
from model.files import atomic_write, make_folder
from model.textures.dataset import Texture, open_dataset

ALL_TICKS = 10**6  # more than any scan has: WAVES=1 alone would cut the scan short of the mismatch
WAVE_TICKS = 200
"""Sample ticks of a scan when a waveform is left, and in the slow simulator, unless told otherwise."""


@dataclass(frozen=True)
class Plan:
    """What is played of every configuration.

    Attributes
    ----------
    simulator : "verilator" or "icarus"
    waves : bool
        Whether a waveform is left.
    seed : int
        Of the scenarios.
    scenarios : int
        How many scenarios are played.
    dataset : str
        Place of the textures.
    textures : list of Texture
    ticks : int or None
        Sample ticks of a scan at most.
    out : Path
        Folder for pictures and event files.
    """

    simulator: Simulator
    waves: bool
    seed: int
    scenarios: int
    dataset: str
    textures: list[Texture]
    ticks: int | None
    out: Path

    def place(self, config: ReadoutConfig) -> str:
        """Return the name of the folder of a configuration in ``out``."""
        return f"{config.rows}x{config.columns}-{config.encoding}-{config.resolution}b"

    def running(self, config: ReadoutConfig) -> Path:
        """Return the folder in which the simulation runs and leaves its log."""
        return self.out / self.place(config) / "run"

    def waveform(self, config: ReadoutConfig) -> Path:
        """Return the waveform of a configuration."""
        return self.running(config) / ("waves.vcd" if self.simulator == "verilator" else "waves.fst")


def plan(
    simulator: str,
    waves: bool,
    seed: int,
    textures: int,
    only: str | None,
    ticks: int | None,
    dataset: str | None,
    out: Path,
) -> Plan:
    """Return the plan that a user asked for; ``textures`` is their number, ``only`` the name of a single one."""
    require_programs(simulator)  # type: ignore[arg-type]
    if textures < 0 or seed < 0 or (ticks is not None and ticks < 1):
        raise InputError(f"textures and seed must be at least 0 and ticks at least 1, not {textures}, {seed}, {ticks}")
    data = open_dataset(dataset or "embedded")
    picked = [data[number] for number in _one_of_each_class(data.labels, textures)]
    if only is not None:
        picked = [named(data, only)]
    if ticks is None and (waves or simulator == "icarus"):
        ticks = WAVE_TICKS
    scenarios = 0 if only else len(STIMULI) + 1
    return Plan(simulator, waves, seed, scenarios, dataset or "embedded", picked, ticks, out)  # type: ignore[arg-type]


def play(plan: Plan, config: ReadoutConfig, on_run: Callable[[Any], None], on_stage: Callable[[str], None]) -> Tally:
    """Play all runs of a configuration and return what was compared.

    Parameters
    ----------
    plan : Plan
    config : ReadoutConfig
    on_run : callable
        Called with each finished run.
    on_stage : callable
        Called with what begins.

    Raises
    ------
    MismatchFound
        If RTL and model differ.
    """
    on_stage(f"building for {plan.simulator}")
    program = build(config, plan.simulator, waves=plan.waves)
    place = plan.place(config)
    again = reproduce(config, plan.simulator, plan.seed)
    if plan.textures:
        again = f"{again.replace(' TEXTURES=0', '')} DATASET={plan.dataset} TICKS={plan.ticks or ALL_TICKS}"
    job = Job(
        config.to_dict(),
        again,
        seed=plan.seed if plan.scenarios else None,
        dataset=plan.dataset,
        textures={texture.name: proof(program, texture) for texture in plan.textures},
        ticks=plan.ticks,
        keep=str(make_folder(plan.out, f"{place}/events").resolve()),
    )
    on_stage("RTL against model")
    tally = run_job(program, job, make_folder(plan.out, f"{place}/run", empty=True), on_run)
    if plan.textures:
        on_stage("picture")
        _picture(config, plan.textures[0], plan.out / place, plan.ticks)
    on_stage("done")
    return tally


def _one_of_each_class(labels: Any, count: int) -> list[int]:
    """Return the numbers of some textures: the first of each class, then the second of each, and so on."""
    order = sorted(range(len(labels)), key=lambda i: (sum(labels[:i] == labels[i]), labels[i]))
    return order[:count]


def _picture(config: ReadoutConfig, texture: Texture, folder: Path, ticks: int | None) -> None:
    """Draw the RTL's events of a scan over the model's, and write the model's beside them."""
    from model.events.recording import Recording
    from model.figures.raster import plot_comparison
    from model.readout import simulate
    from model.textures.physical import PhysicalScan

    recorded = folder / "events" / f"{texture.name}.npz"
    rtl = Recording.load(recorded)
    image = texture.load()
    if rtl.metadata["dataset"] == "embedded":
        image = large_enough(image, config)
    samples = PhysicalScan().samples(config, image)[0][:ticks]
    model = simulate(config, settled(config, samples))
    Recording(model, config, rtl.duration_clocks, metadata=rtl.metadata | {"source": "model"}).save(
        folder / "model.npz"
    )
    with atomic_write(folder / "rtl.npz") as file:
        file.write(recorded.read_bytes())
    plot_comparison(
        (rtl.events, model),
        config,
        folder / "raster.png",
        labels=("RTL", "model"),
        title=f"{texture.name}, {config.encoding} {config.resolution} b, {config.rows} x {config.columns} taxels",
        signal=samples / config.full_scale,
        texture=image,
        duration_clocks=rtl.duration_clocks,
    )
