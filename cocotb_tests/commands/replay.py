"""The command replay: a whole dataset through RTL and model."""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from model.cli.app import printable
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

    from cocotb_tests.session import replay as session
    from cocotb_tests.session.session import MismatchFound

    workers = workers if workers is not None else os.cpu_count() or 1
    if workers < 1:
        raise InputError(f"workers must be at least 1, not {workers}")
    plan = session.plan(config, dataset, preset, start_row, limit, only, out)
    print(f"building {plan.array} for Verilator", file=sys.stderr)
    missing = [texture for texture in plan.textures if plan.finished(texture) is None]
    started = time.monotonic()
    with Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TimeRemainingColumn(elapsed_when_finished=True), console=Console(stderr=True),
    ) as progress:  # fmt: skip
        name = f"{plan.data.name}, {plan.config.encoding} {plan.config.resolution} b"
        images = len(plan.textures)
        task = progress.add_task(name, total=images, completed=images - len(missing))
        try:
            total = session.play(plan, missing, workers, lambda _: progress.advance(task))
        except MismatchFound as mismatch:
            progress.stop()
            print(f"{mismatch}\nMISMATCH")
            raise typer.Exit(1) from None
    seconds = time.monotonic() - started
    summary = session.summarise(plan)
    if (absent := summary.pop("missing")) or not summary["events"]:
        print(f"FAILED: {absent} of {images} recordings are missing, {summary['events']} events")
        raise typer.Exit(1)
    summary["played_now"] = {
        "images": len(missing),
        "clocks": total.clocks,
        "seconds": round(seconds, 1),
        "workers": workers,
    }
    summary["configuration"] = plan.config.to_dict()
    with atomic_write(plan.folder / "summary.json") as file:
        file.write((json.dumps(summary, indent=2) + "\n").encode())
    print(printable(f"events per image: {plan.events}; played now: {len(missing)} images in {seconds:.0f} s"))
    print(f"bit-exact: {images} runs, {summary['clocks']} clocks, {summary['events']} events, 0 mismatches")
