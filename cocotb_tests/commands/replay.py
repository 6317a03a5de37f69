"""The command replay: a whole dataset through RTL and model."""

from __future__ import annotations

import functools
import hashlib
import json
import os
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated

import typer

from cocotb_tests.commands.sim import _advance, _named, _variables
from cocotb_tests.session.player import Job
from cocotb_tests.session.proof import proof
from cocotb_tests.session.session import MismatchFound, Tally, run_job
from cocotb_tests.session.simulator import build, require_programs
from model.cli.config_options import with_config
from model.config import ReadoutConfig
from model.errors import InputError
from model.files import atomic_write


@with_config
def replay(
    config: ReadoutConfig,
    dataset: Annotated[
        str | None, typer.Option(help="texture folder, or 'embedded' [$ESKIN_DATA, data/kylberg, ...]")
    ] = None,
    preset: Annotated[str, typer.Option(help="physical or paper")] = "physical",
    start_row: Annotated[float, typer.Option(help="image row where the array starts (physical)")] = 0.0,
    limit: Annotated[int | None, typer.Option(help="only so many textures, spread over the classes")] = None,
    only: Annotated[str | None, typer.Option(help="only one texture, by its name")] = None,
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

    from model.events.recording import Recording
    from model.textures.dataset import Texture, open_dataset
    from model.textures.presets import preset as scan_of

    require_programs("verilator")
    workers = workers if workers is not None else os.cpu_count() or 1
    if workers < 1:
        raise InputError(f"workers must be at least 1, not {workers}")
    data = open_dataset(dataset)
    textures = [_named(data, only)] if only is not None else list(data.limit(limit) if limit is not None else data)
    config = scan_of(preset).configure(config, config.tau_s if config.encoding == "nlcs" else None)
    origin = hashlib.sha256(f"{config.to_json()} {start_row}".encode()).hexdigest()[:6]
    array = f"{config.rows}x{config.columns}-{config.encoding}-{config.resolution}b"
    folder = out / f"{data.name}-{preset}-{array}-{origin}"
    events = folder / "events"
    folder.mkdir(parents=True, exist_ok=True)
    print(f"building {array} for Verilator", file=sys.stderr)
    program = build(config, "verilator")
    proofs = {texture.name: proof(program, texture, start_row) for texture in textures}

    def finished(texture: Texture) -> Recording | None:
        """Return the recording of a texture, if this very RTL, model and image made it."""
        try:
            found = Recording.load(events / f"{texture.name}.npz")
        except InputError:
            return None
        return found if found.metadata.get("proof") == proofs[texture.name] else None

    missing = [texture for texture in textures if finished(texture) is None]
    started = time.monotonic()
    total = Tally()
    stop = threading.Event()
    console = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TimeRemainingColumn(elapsed_when_finished=True), console=console,
    ) as progress:  # fmt: skip
        name = f"{data.name}, {config.encoding} {config.resolution} b"
        task = progress.add_task(name, total=len(textures), completed=len(textures) - len(missing))

        def work(part: int) -> Tally:
            mine = missing[part::workers]
            if not mine or stop.is_set():
                return Tally()
            again = [
                *_variables(config),
                f"PRESET={preset}",
                f"START_ROW={start_row}",
                f"DATASET={dataset or data.name}",
            ]
            job = Job(
                config.to_dict(),
                " ".join(["make replay", *again]),
                dataset=dataset,
                preset=preset,
                textures={texture.name: proofs[texture.name] for texture in mine},
                start_row=start_row,
                keep=str(events.resolve()),
            )
            with tempfile.TemporaryDirectory() as running:
                return run_job(program, job, Path(running), functools.partial(_advance, progress, task))

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
    recordings = [finished(texture) for texture in textures]
    clocks = sum(r.duration_clocks for r in recordings if r)
    count = sum(len(r.events) for r in recordings if r)
    if None in recordings or not count:
        print(f"FAILED: {recordings.count(None)} of {len(textures)} recordings are missing, {count} events")
        raise typer.Exit(1)
    summary = {
        "dataset": data.name,
        "preset": preset,
        "start_row": start_row,
        "images": len(textures),
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
    with atomic_write(folder / "summary.json") as file:
        file.write((json.dumps(summary, indent=2) + "\n").encode())
    print(f"events per image: {events}; played now: {len(missing)} images in {seconds:.0f} s")
    print(f"bit-exact: {len(textures)} runs, {clocks} clocks, {count} events, 0 mismatches")
