"""The command noise-power (docs/results/what_events_are_good_for.md)."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Any

import typer

from model.cli.app import printable
from model.cli.progress import bar
from model.cli.tables import new_table, show
from model.errors import InputError
from model.files import check_writable, write_json
from snn.commands.options import check_device
from snn.commands.robustness import trained_files
from snn.commands.sweep import command_line

NOISES_MV = "0.1,1,3,10,20"
Pair = Annotated[str | None, typer.Option(metavar="A,B", help="two networks, to be compared image by image")]


def noise_power(
    context: typer.Context,
    weights: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="DIR...", help="folders NETWORK/TRAINING/ of snn train, one a fold and seed [out/train]"
        ),
    ] = None,
    noises: Annotated[str, typer.Option(metavar="MV,...", help="AFE output noise v_n, mV rms of 1 V")] = NOISES_MV,
    pair: Pair = None,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="cells, noise_power.json and .png")] = Path(
        "out/noise-power"
    ),
) -> None:
    """Accuracy, event rate and power of trained networks at one AFE noise, in both modes of the power model."""
    from snn.experiments.robustness import Subject
    from snn.figures.noise_power import plot_noise_power
    from snn.studies.noise import MODES, points_of, under_noise
    from snn.studies.paired import paired

    noises_v = [1e-3 * number for number in _numbers(noises)]
    check_device("cpu", 1)
    subjects = [Subject.load(path, scenes=False) for path in trained_files(weights or [Path("out/train")])]
    names = two_of(pair, {subject.network for subject in subjects})
    out.mkdir(parents=True, exist_ok=True)
    for name in ("noise_power.json", "noise_power.png"):
        check_writable(out / name)
    with bar("scans", sum(len(subject.images) for subject in subjects)) as step:
        cells = under_noise(subjects, noises_v, out, step)
    points = points_of(subjects, cells)
    pairs = paired(points, names[0], names[1], ("mode", "noise_v")) if names else []
    write_json(out / "noise_power.json", {"command": command_line(context), "points": points, "pairs": pairs})
    plot_noise_power(points, out / "noise_power.png")
    for mode in MODES:
        _print_table([point for point in points if point["mode"] == mode], mode)
    for one in pairs:
        counts = f"only {one['first']} right {one['only_first']}, only {one['second']} {one['only_second']}"
        print(f"{one['mode']}, {1e3 * one['noise_v']:g} mV: {counts} of {one['images']}, McNemar p {one['p']:.2g}")
    print(printable(f"result: {out / 'noise_power.json'}, picture: {out / 'noise_power.png'}"))


def two_of(text: str | None, known: Collection[str]) -> list[str]:
    """Return the two networks that are to be compared; none where none are named."""
    names = [name.strip() for name in text.split(",")] if text is not None else []
    if text is not None and (len(names) != 2 or not set(names) <= set(known)):
        raise InputError(f"--pair takes two of {', '.join(sorted(known))}, with a comma between, not {text!r}")
    return names


def _numbers(text: str) -> list[float]:
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if not found or not all(0 < number < 1000 for number in found):
        raise InputError(f"--noises takes positive numbers of mV below 1000 with commas between, not {text!r}")
    return found


def _print_table(points: list[dict[str, Any]], mode: str) -> None:
    from model.figures.units import with_unit

    table = new_table(("network", "v_n", "accuracy", "95 % interval", "events/s", "power"), f"mode {mode}", left=(0,))
    for point in points:
        low, high = point["bootstrap_95"]
        table.add_row(
            printable(point["network"]),
            f"{1e3 * point['noise_v']:g} mV",
            f"{100 * point['accuracy']:.1f}",
            f"{100 * low:.0f} to {100 * high:.0f}",
            f"{point['rate_hz']:.0f}",
            with_unit(point["power_w"]["total"], "W"),
        )
    show(table)
