"""The command sim: scenarios and texture scans through RTL and model."""

from __future__ import annotations

import dataclasses
import functools
import shutil
from pathlib import Path
from typing import Annotated, Any

import typer

from cocotb_tests.bench.stimuli import STIMULI, settled
from cocotb_tests.bench.textures import large_enough
from cocotb_tests.session.player import Job
from cocotb_tests.session.proof import proof
from cocotb_tests.session.session import MismatchFound, Tally, run_job
from cocotb_tests.session.simulator import build, require_programs
from model.cli.config_options import option_name, with_config
from model.config import ReadoutConfig
from model.errors import InputError

ALL_TICKS = 10**6  # more than any scan has: WAVES=1 alone would cut the scan short of the mismatch
WAVE_TICKS = 200
"""Sample ticks of a scan when a waveform is left, and in the slow simulator, unless told otherwise."""


def reproduce(config: ReadoutConfig, simulator: str, seed: int) -> str:
    """Return the command that plays the scenarios of a configuration again and leaves a waveform."""
    return " ".join(["make sim", *_variables(config), f"SIM={simulator}", f"SEED={seed}", "TEXTURES=0", "WAVES=1"])


@with_config
def sim(
    config: ReadoutConfig,
    given: frozenset[str],
    simulator: Annotated[str, typer.Option("--sim", help="verilator or icarus")] = "verilator",
    waves: Annotated[bool, typer.Option(help="leave a waveform")] = False,
    seed: Annotated[int, typer.Option(help="seed of the scenarios")] = 0,
    textures: Annotated[int, typer.Option(help="texture scans of each encoding, one class after the other")] = 3,
    only: Annotated[str | None, typer.Option(help="one texture, by its name, and no scenarios")] = None,
    ticks: Annotated[int | None, typer.Option(help="sample ticks of a scan at most [all]")] = None,
    dataset: Annotated[str | None, typer.Option(help="texture folder, or 'embedded'")] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="folder for pictures and event files")] = Path("out/sim"),
) -> None:
    """Hold the RTL to the model on scenarios and texture scans; exit code 1 if they differ."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        SpinnerColumn,
        TextColumn,
        TimeElapsedColumn,
    )

    from model.textures.dataset import open_dataset

    require_programs(simulator)  # type: ignore[arg-type]
    if textures < 0 or seed < 0 or (ticks is not None and ticks < 1):
        raise InputError(f"textures and seed must be at least 0 and ticks at least 1, not {textures}, {seed}, {ticks}")
    data = open_dataset(dataset or "embedded")
    picked = [data[number] for number in _one_of_each_class(data.labels, textures)]
    if only is not None:
        picked, seed_to_play = [_named(data, only)], None
    else:
        seed_to_play = seed
    if ticks is None and (waves or simulator == "icarus"):
        ticks = WAVE_TICKS
    scenarios_to_play = 0 if only else len(STIMULI) + 1
    encodings = [config.encoding] if "encoding" in given else ["lcs", "cw-lcs", "nlcs"]
    total = Tally()
    out.mkdir(parents=True, exist_ok=True)
    console = Console(stderr=True)
    with Progress(
        SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        console=console,
    ) as progress:  # fmt: skip
        for encoding in encodings:
            chosen = config.replace(encoding=encoding)
            task = progress.add_task(f"{encoding}: building for {simulator}", total=scenarios_to_play + len(picked))
            program = build(chosen, simulator, waves=waves)  # type: ignore[arg-type]
            folder = out / f"{chosen.rows}x{chosen.columns}-{encoding}-{chosen.resolution}b"
            again = reproduce(chosen, simulator, seed)
            if picked:
                again = f"{again.replace(' TEXTURES=0', '')} DATASET={dataset or 'embedded'} TICKS={ticks or ALL_TICKS}"
            job = Job(
                chosen.to_dict(),
                again,
                seed=seed_to_play,
                dataset=dataset or "embedded",
                textures={texture.name: proof(program, texture) for texture in picked},
                ticks=ticks,
                keep=str((folder / "events").resolve()),
            )
            progress.update(task, description=f"{encoding}: RTL against model")
            try:
                total += run_job(program, job, folder / "run", functools.partial(_advance, progress, task))
            except MismatchFound as mismatch:
                progress.stop()
                print(f"{mismatch}\nMISMATCH after {total.runs} bit-exact runs; log: {folder / 'run'}")
                raise typer.Exit(1) from None
            if picked:
                progress.update(task, description=f"{encoding}: picture")
                _picture(chosen, picked[0], folder, ticks)
            progress.update(task, description=f"{encoding}: done")
            if waves:
                wave = folder / "run" / ("waves.vcd" if simulator == "verilator" else "waves.fst")
                print(f"waveform: {wave}; open it with: gtkwave {wave}")
    if not total.events or not total.drained:
        print(f"FAILED: {total.events} events were compared, {total.drained} runs left nothing outstanding")
        raise typer.Exit(1)
    print(f"pictures and event files: {out}")
    print(f"bit-exact: {total.runs} runs, {total.clocks} clocks, {total.events} events, 0 mismatches")


def _advance(progress: Any, task: Any, _: dict[str, Any]) -> None:
    progress.advance(task)


def _named(data: Any, name: str) -> Any:
    """Return the texture of a name."""
    for texture in data:
        if texture.name == name:
            return texture
    raise InputError(f"dataset {data.name} has no texture {name!r}; one of them is {data[0].name}")


def _one_of_each_class(labels: Any, count: int) -> list[int]:
    """Return the numbers of some textures: the first of each class, then the second of each, and so on."""
    order = sorted(range(len(labels)), key=lambda i: (sum(labels[:i] == labels[i]), labels[i]))
    return order[:count]


def _picture(config: ReadoutConfig, texture: Any, folder: Path, ticks: int | None) -> None:
    """Draw the RTL's events of a scan over the model's, and write the model's beside them."""
    from model.events.recording import Recording
    from model.figures.raster import plot_comparison
    from model.readout import simulate
    from model.textures.physical import PhysicalScan

    rtl = Recording.load(folder / "events" / f"{texture.name}.npz")
    image = texture.load()
    if rtl.metadata["dataset"] == "embedded":
        image = large_enough(image, config)
    samples = PhysicalScan().samples(config, image)[0][:ticks]
    model = simulate(config, settled(config, samples))
    Recording(model, config, rtl.duration_clocks, metadata=rtl.metadata | {"source": "model"}).save(
        folder / "model.npz"
    )
    shutil.copyfile(folder / "events" / f"{texture.name}.npz", folder / "rtl.npz")
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


def _variables(config: ReadoutConfig) -> list[str]:
    """Return what to write behind make for a configuration: the fields that do not have their default."""
    return [
        f"{option_name(field.name)[2:].replace('-', '_').upper()}={getattr(config, field.name)}"
        for field in dataclasses.fields(config)
        if getattr(config, field.name) != field.default
    ]
