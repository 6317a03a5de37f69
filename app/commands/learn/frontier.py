"""The command frontier (docs/guide/classifier.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from eskin.app.cli import asked_for, printable
from eskin.app.commands.learn.options import Seeds, check_device
from eskin.app.commands.signals.options import TexturesOption
from eskin.app.options import WRITES_FOLDER
from eskin.app.tables import filled
from eskin.base.errors import InputError
from eskin.base.figures.files import write_results
from eskin.base.progress import bar


def frontier(
    points: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="POINT...",
            help="PRESET/NETWORK/READOUT/TAXELS, such as physical/leaky/lcs:3/across:4 [all documented points]",
        ),
    ] = None,
    seeds: Seeds = 1,
    device: Annotated[
        str, typer.Option(help="device name of torch; a GPU trains the convolutional networks of a point together")
    ] = "cpu",
    inner: Annotated[
        int | None,
        typer.Option(
            min=1, max=6, metavar="FOLDS", help="only inner validation, in this number of folds, without test images"
        ),
    ] = None,
    draw: Annotated[Path | None, typer.Option(metavar="FILE", help="plot this frontier.json without training")] = None,
    dataset: TexturesOption = None,
    out: Annotated[
        Path,
        typer.Option("-o", "--out", metavar="DIR", help="folder for results, frontier.json and .png"),
        WRITES_FOLDER,
    ] = Path("out/frontier"),
) -> None:
    """Train networks on chosen taxels, and compare accuracy with events/s, bits/s and power.

    Without POINT, inner validation chooses a readout of every encoder, and frames, at every event rate. A stopped run
    continues with the missing trainings.
    """
    from eskin.base.shapes import read_shaped
    from eskin.snn.experiments.points import load_sweep
    from eskin.snn.figures.fig9 import KEPT
    from eskin.snn.figures.frontier import plot_frontier
    from eskin.snn.studies.frontier import (
        FOLDS,
        SHAPE,
        SWEEPS,
        Frontier,
        Point,
        frontier_data,
        measured,
        points_of,
    )

    out.mkdir(parents=True, exist_ok=True)
    if draw is not None:
        if points or inner is not None:
            raise InputError("--draw draws a finished file; leave points and --inner out")
        plot_frontier(read_shaped(draw, "the frontier", SHAPE), out / "frontier.png")
        print(printable(f"wrote {out / 'frontier.png'}"))
        return
    if inner is not None and not points:
        raise InputError("--inner needs points, such as physical/leaky/lcs:3/across:4")
    named = [Point.parse(text) for text in points or ()]
    check_device(device, 1)
    run = Frontier(out / "frontier.json", dataset, device)
    trainings = (inner or FOLDS * seeds) * len(named) if named else None
    made, validated = [], []
    with bar("cells", trainings) as step:
        if not named:
            made, validated = measured(run, step)
        elif inner is not None:
            validated = [run.inner(point, inner, step) for point in named]
        else:
            made = [run.point(point, seeds, step) for point in named]
    for one in validated:
        print(printable(f"{one['name']}: {100 * one['accuracy']:.1f} % in inner validation of {one['folds']} folds"))
    if inner is not None:
        return
    for name, network in ({} if points else SWEEPS).items():
        made += points_of(load_sweep(KEPT / f"{name}.json"), network)
    data = frontier_data(made, validated)
    line = "{name}: {accuracy:100*.1f} % ({interval[0]:100*.1f} to {interval[1]:100*.1f}), seeds: {seeds}; "
    line += "{rate_hz:,.0f} events or values/s, {bits_per_s:,.0f} bits/s"
    for point in data["points"]:
        print(printable(filled(line, point)))
    print(printable(write_results(out, "frontier", data, plot_frontier, command=asked_for())))
