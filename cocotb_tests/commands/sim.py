"""The command sim: scenarios and texture scans through RTL and model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from model.cli.app import printable
from model.cli.config_options import with_config
from model.cli.progress import bar
from model.commands.recordings import print_set, warn
from model.config import ReadoutConfig
from model.errors import InputError


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
    data: Annotated[
        Path | None, typer.Option(metavar="DIR", help="your own recordings instead: class folders, or a file")
    ] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="folder for pictures and event files")] = Path("out/sim"),
) -> None:
    """Hold the RTL to the model on scenarios and texture scans, or your recordings; exit code 1 if they differ."""
    if data is not None:
        if only is not None or dataset is not None:
            raise InputError("--data plays your own recordings; leave out --only and --dataset")
        _sim_own(data, config, given, simulator, waves, textures, ticks, out)
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        SpinnerColumn,
        TextColumn,
        TimeElapsedColumn,
    )

    from cocotb_tests.session import sim as session
    from cocotb_tests.session.session import MismatchFound, Tally

    plan = session.plan(simulator, waves, seed, textures, only, ticks, dataset, out)
    encodings = [config.encoding] if "encoding" in given else ["lcs", "cw-lcs", "nlcs"]
    total = Tally()
    with Progress(
        SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        console=Console(stderr=True),
    ) as progress:  # fmt: skip
        for encoding in encodings:
            chosen = config.replace(encoding=encoding)
            task = progress.add_task(encoding, total=plan.scenarios + len(plan.textures))
            try:
                total += session.play(
                    plan,
                    chosen,
                    lambda _, task=task: progress.advance(task),  # type: ignore[misc]
                    lambda stage, task=task, encoding=encoding: progress.update(  # type: ignore[misc]
                        task, description=f"{encoding}: {stage}"
                    ),
                )
            except MismatchFound as mismatch:
                progress.stop()
                print(f"{mismatch}\nMISMATCH after {total.runs} bit-exact runs; log: {plan.running(chosen)}")
                raise typer.Exit(1) from None
            if waves:
                wave = plan.waveform(chosen)
                print(f"waveform: {wave}; open it with: gtkwave {wave}")
    if not total.events or not total.drained:
        print(f"FAILED: {total.events} events were compared, {total.drained} runs left nothing outstanding")
        raise typer.Exit(1)
    print(printable(f"pictures and event files: {out}"))
    print(f"bit-exact: {total.runs} runs, {total.clocks} clocks, {total.events} events, 0 mismatches")


def _sim_own(place: Path, config: ReadoutConfig, given: frozenset[str], *rest: Any) -> None:
    """Play a user's own recordings through RTL and model, with the encoding that was chosen, or all three."""
    from cocotb_tests.session import own as session
    from cocotb_tests.session.session import MismatchFound, Tally

    total = Tally()
    for encoding in [config.encoding] if "encoding" in given else ["lcs", "cw-lcs", "nlcs"]:
        plan = session.plan(place, config.replace(encoding=encoding), given, *rest)
        print_set(plan.recordings)
        warn(plan.recordings.warnings)
        with bar(f"{encoding}: RTL against model", len(plan.names)) as progress:
            try:
                total += session.play(plan, lambda _, progress=progress: progress())  # type: ignore[misc]
            except MismatchFound as mismatch:
                print(f"{mismatch}\nMISMATCH after {total.runs} bit-exact runs")
                raise typer.Exit(1) from None
        print(f"pictures and event files: {plan.out / plan.folder}")
    if not total.events or not total.drained:
        print(f"FAILED: {total.events} events were compared, {total.drained} runs left nothing outstanding")
        raise typer.Exit(1)
    print(f"bit-exact: {total.runs} runs, {total.clocks} clocks, {total.events} events, 0 mismatches")
