"""The commands behind ``make sim`` and ``make replay``."""

from __future__ import annotations

import dataclasses
import functools
import json
import os
import shutil
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated, Any

import typer

from cocotb_tests.player import Job
from cocotb_tests.session import MismatchFound, Tally, run_job
from cocotb_tests.simulator import build, require_programs
from model.cli import option_name, with_config
from model.config import ReadoutConfig
from model.errors import InputError

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

    from model.dataset import open_dataset

    require_programs(simulator)  # type: ignore[arg-type]
    if textures < 0 or (ticks is not None and ticks < 1):
        raise InputError(f"textures must be at least 0 and ticks at least 1, not {textures} and {ticks}")
    data = open_dataset(dataset or "embedded")
    picked = _one_of_each_class(data.labels, textures)
    if ticks is None and (waves or simulator == "icarus"):
        ticks = WAVE_TICKS
    encodings = [config.encoding] if "encoding" in given else ["lcs", "cw-lcs", "nlcs"]
    total = Tally()
    console = Console(stderr=True)
    with Progress(
        SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        console=console,
    ) as progress:  # fmt: skip
        for encoding in encodings:
            chosen = config.replace(encoding=encoding)
            task = progress.add_task(f"{encoding}: building for {simulator}", total=8 + len(picked))
            program = build(chosen, simulator, waves=waves)  # type: ignore[arg-type]
            folder = out / f"{chosen.rows}x{chosen.columns}-{encoding}-{chosen.resolution}b"
            job = Job(
                chosen.to_dict(),
                reproduce(chosen, simulator, seed).replace(" TEXTURES=0", f" TEXTURES={textures}"),
                seed=seed,
                dataset=dataset or "embedded",
                textures=[data[number].name for number in picked],
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
                _picture(chosen, data[picked[0]], folder, ticks)
            progress.update(task, description=f"{encoding}: done")
            if waves:
                wave = folder / "run" / ("waves.vcd" if simulator == "verilator" else "waves.fst")
                print(f"waveform: {wave}; open it with: gtkwave {wave}")
    if not total.events:
        print("FAILED: no event was compared")
        raise typer.Exit(1)
    print(f"pictures and event files: {out}")
    print(f"bit-exact: {total.runs} runs, {total.clocks} clocks, {total.events} events, 0 mismatches")


def _advance(progress: Any, task: Any, _: dict[str, Any]) -> None:
    progress.advance(task)


def _one_of_each_class(labels: Any, count: int) -> list[int]:
    """Return the numbers of some textures: the first of each class, then the second of each, and so on."""
    order = sorted(range(len(labels)), key=lambda i: (sum(labels[:i] == labels[i]), labels[i]))
    return order[:count]


def _picture(config: ReadoutConfig, texture: Any, folder: Path, ticks: int | None) -> None:
    """Draw the RTL's events of a scan over the model's, and write the model's beside them."""
    from model.events import Recording
    from model.raster import plot_comparison
    from model.readout import Stimulus, simulate
    from model.texture import PhysicalScan

    rtl = Recording.load(folder / "events" / f"{texture.name}.npz")
    samples, _ = PhysicalScan().samples(config, texture.load())
    samples = samples[:ticks]
    model = simulate(config, Stimulus.from_samples(config, samples))
    Recording(model, config, rtl.duration_clocks, metadata=rtl.metadata | {"source": "model"}).save(
        folder / "model.npz"
    )
    shutil.copyfile(folder / "events" / f"{texture.name}.npz", folder / "rtl.npz")
    plot_comparison(
        rtl.events,
        model,
        config,
        folder / "raster.png",
        labels=("RTL", "model"),
        title=f"{texture.name}, {config.encoding} {config.resolution} b, {config.rows} x {config.columns} taxels",
        signal=samples / config.full_scale,
        texture=texture.load(),
        duration_clocks=rtl.duration_clocks,
    )


@with_config
def replay(
    config: ReadoutConfig,
    dataset: Annotated[
        str | None, typer.Option(help="texture folder, or 'embedded' [$ESKIN_DATA, data/kylberg, ...]")
    ] = None,
    preset: Annotated[str, typer.Option(help="physical or paper")] = "physical",
    start_row: Annotated[float, typer.Option(help="image row where the array starts (physical)")] = 0.0,
    limit: Annotated[int | None, typer.Option(help="only the first so many textures")] = None,
    workers: Annotated[int | None, typer.Option(help="simulations side by side [cores]")] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="folder for the event files")] = Path("out/replay"),
) -> None:
    """Drive a whole dataset through RTL and model, compare every event, keep the RTL's events per image.

    Can be stopped and started again: images whose events are already there, for the same configuration, are done.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    from model.dataset import open_dataset
    from model.events import Recording
    from model.texture import preset as scan_of

    require_programs("verilator")
    workers = workers if workers is not None else os.cpu_count() or 1
    if workers < 1:
        raise InputError(f"workers must be at least 1, not {workers}")
    data = open_dataset(dataset)
    if limit is not None:
        data = data.limit(limit)
    config = scan_of(preset).configure(config, config.tau_s if config.encoding == "nlcs" else None)
    folder = out / f"{data.name}-{preset}-{config.rows}x{config.columns}-{config.encoding}-{config.resolution}b"
    events = folder / "events"

    def finished(number: int) -> Recording | None:
        try:
            found = Recording.load(events / f"{data[number].name}.npz")
        except InputError:
            return None
        same = found.config == config and found.metadata.get("start_row") == start_row
        return found if same and found.metadata.get("preset") == preset else None

    missing = [number for number in range(len(data)) if finished(number) is None]
    started = time.monotonic()
    total = Tally()
    stop = threading.Event()
    console = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TimeRemainingColumn(elapsed_when_finished=True), console=console,
    ) as progress:  # fmt: skip
        task = progress.add_task("building", total=len(data), completed=len(data) - len(missing))
        program = build(config, "verilator")
        progress.update(task, description=f"{data.name}, {config.encoding} {config.resolution} b")

        def work(part: int) -> Tally:
            numbers = missing[part::workers]
            if not numbers or stop.is_set():
                return Tally()
            command = (
                f"make replay {' '.join(_variables(config))} PRESET={preset} DATASET={dataset or data.name} WORKERS=1"
            )
            job = Job(
                config.to_dict(),
                command,
                dataset=dataset,
                preset=preset,
                textures=[data[number].name for number in numbers],
                start_row=start_row,
                keep=str(events.resolve()),
            )
            running = folder / f"run-{os.getpid()}-{part}"
            tally = run_job(program, job, running, functools.partial(_advance, progress, task))
            shutil.rmtree(running)
            return tally

        with ThreadPoolExecutor(workers) as pool:
            try:
                for tally in pool.map(work, range(workers)):
                    total += tally
            except MismatchFound as mismatch:
                stop.set()
                progress.stop()
                print(f"{mismatch}\nMISMATCH")
                raise typer.Exit(1) from None
    seconds = time.monotonic() - started
    recordings = [finished(number) for number in range(len(data))]
    clocks = sum(r.duration_clocks for r in recordings if r)
    count = sum(len(r.events) for r in recordings if r)
    if None in recordings or not count:
        print(f"FAILED: {recordings.count(None)} of {len(data)} recordings are missing, {count} events")
        raise typer.Exit(1)
    summary = {
        "dataset": data.name,
        "preset": preset,
        "start_row": start_row,
        "images": len(data),
        "clocks": clocks,
        "events": count,
        "mismatches": 0,
        "population_rate_hz": count / (clocks / config.clock_hz),
        "played_now": {
            "images": len(missing),
            "clocks": total.clocks,
            "seconds": round(seconds, 1),
            "workers": workers,
        },
        "configuration": config.to_dict(),
    }
    (folder / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    print(f"events per image: {events}; played now: {len(missing)} images in {seconds:.0f} s")
    print(f"bit-exact: {len(data)} runs, {clocks} clocks, {count} events, 0 mismatches")


def _variables(config: ReadoutConfig) -> list[str]:
    """Return what to write behind make for a configuration: the fields that do not have their default."""
    return [
        f"{option_name(field.name)[2:].replace('-', '_').upper()}={getattr(config, field.name)}"
        for field in dataclasses.fields(config)
        if getattr(config, field.name) != field.default
    ]
