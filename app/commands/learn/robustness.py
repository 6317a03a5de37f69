"""The command robustness (docs/guide/robustness.md)."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from eskin.app.cli import echo
from eskin.app.commands.learn.options import check_device
from eskin.app.commands.learn.sweep import command_line
from eskin.app.leave import EXIT_INTERRUPTED
from eskin.app.options import arg, opt, out_folder
from eskin.app.tables import filled, print_table
from eskin.base.errors import InputError
from eskin.base.figures.files import write_results
from eskin.base.progress import bar

if TYPE_CHECKING:
    from eskin.snn.experiments.robustness import Subject

OUT_TRAIN = Path("out/train")
"""Default folder of trainings; the search includes all folders with this beginning of the name."""

Trainings = Annotated[
    list[Path] | None,
    arg(
        ...,
        "DIR...",
        "folders NETWORK/TRAINING/ of eskin train, one for each fold and seed [suitable ones in out/train]",
    ),
]


def robustness(
    context: typer.Context,
    weights: Trainings = None,
    only: str | None = opt(None, "NAME[=STRENGTH],...", "disturbances [all, at all strengths]"),
    out: Path = out_folder(Path("out/robustness"), "DIR", "folder for results, robustness.json and .png"),
) -> None:
    """Test trained networks with noise, mismatch, faults and other movements.

    A stopped run continues with the missing tests.
    """
    from eskin.snn.data.disturb import DISTURBANCES
    from eskin.snn.experiments.robustness import cases, run_cells, summarise
    from eskin.snn.figures.robustness import plot_robustness

    chosen = cases(list(DISTURBANCES) if only is None else [name.strip() for name in only.split(",")])
    check_device("cpu", 1)
    subjects = subjects_of(weights)
    places = [(subject.network, subject.fold, subject.seed) for subject in subjects]
    if twice := [place for place in places if places.count(place) > 1]:
        network, fold, seed = twice[0]
        raise InputError(f"network {network!r} has two trainings with fold {fold} and seed {seed}; rename a folder")
    out.mkdir(parents=True, exist_ok=True)
    try:
        with bar("cells", len(subjects) * len(chosen)) as step:
            cells = run_cells(subjects, chosen, out, step)
    except KeyboardInterrupt:
        print(f"stopped; finished results are in {out}; run the same command again to continue", file=sys.stderr)
        raise typer.Exit(EXIT_INTERRUPTED) from None
    points = summarise(cells)
    written = write_results(out, "robustness", {"points": points}, plot_robustness, command=command_line(context))
    _print_table(points)
    echo(written)


def subjects_of(places: list[Path] | None, scenes: bool = True) -> list[Subject]:
    """Return the trained networks in the user's folders, by default the suitable networks below ``OUT_TRAIN``.

    With ``scenes``, only networks on events of physical scans suit. Raises InputError if a network in a folder of the
    user, or every network below ``OUT_TRAIN``, does not suit.
    """
    from eskin.snn.experiments.robustness import Subject

    if places:
        return [Subject.load(file, scenes) for file in trained_files(places)]
    found, left_out = [], []
    for file in sorted(OUT_TRAIN.parent.glob(f"{OUT_TRAIN.name}*/**/weights.npz")):
        try:
            subject = Subject.load(file, scenes)
        except InputError as error:
            left_out.append(str(error))
        else:
            alone = file.parent.parent == OUT_TRAIN.parent
            found.append(dataclasses.replace(subject, network=file.parent.name) if alone else subject)
    if not found:
        why = f"no network in {OUT_TRAIN} suits ({left_out[0]})" if left_out else f"no trained network in {OUT_TRAIN}"
        raise InputError(f"{why}; make one with eskin train{' --preset physical' * scenes}, or name its folder")
    for text in left_out:
        echo(f"left out: {text}", file=sys.stderr)
    return found


def trained_files(places: list[Path]) -> list[Path]:
    """Return the weight files below folders."""
    found = []
    for place in places:
        below = sorted(place.rglob("weights.npz")) if place.is_dir() else [place]
        if not below:
            raise InputError(f"there is no trained network in {place}; make one with eskin train")
        found += below
    return found


def _print_table(points: list[dict[str, Any]]) -> None:
    """Print the accuracy of every network under every disturbance."""
    networks = sorted({point["network"] for point in points})
    rows: dict[tuple[str, float], list[str]] = {}
    for point in points:
        name, strength = point["disturbance"], point["strength"]
        first = [name, "" if name == "clean" else f"{strength:g}", *[""] * len(networks), f"{point['rate_hz']:.0f}"]
        cell = filled("{accuracy:100*.1f} ({bootstrap_95[0]:100*.0f} to {bootstrap_95[1]:100*.0f})", point)
        rows.setdefault((name, strength), first)[2 + networks.index(point["network"])] = cell
    heads = ["disturbance", "strength", *networks, "events/s"]
    print_table(heads, rows.values(), title="accuracy in %, 95 % interval over images and seeds", left=(0, 1))
