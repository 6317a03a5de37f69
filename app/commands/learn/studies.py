"""The commands noise-power, merits and precision: studies of trained networks."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Any

import typer

from eskin.app.cli import printable
from eskin.app.commands.learn.options import DatasetName, check_device
from eskin.app.commands.learn.robustness import Trainings, subjects_of
from eskin.app.commands.learn.sweep import command_line
from eskin.app.options import WRITES_FOLDER
from eskin.app.tables import new_table, show
from eskin.base.errors import InputError
from eskin.base.files import origin, write_json
from eskin.base.progress import bar
from eskin.base.shapes import read_shaped

NOISES_MV = "0.1,1,3,10,20"
VARIANTS = "8,7,6,5,4,3,2,8:t6,8:t4,4:t6,4:t4,4:m16,4:m13,4:m11"
TIMES_MS = (10, 14, 18, 22, 26, 30, 40, 50, 70, 100, 150, 200, 300, 398)

Pair = Annotated[str | None, typer.Option(metavar="A,B", help="two networks to compare image by image")]


def noise_power(
    context: typer.Context,
    weights: Trainings = None,
    noises: Annotated[str, typer.Option(metavar="MV,...", help="AFE output noise v_n, mV rms of 1 V")] = NOISES_MV,
    pair: Pair = None,
    out: Annotated[
        Path,
        typer.Option("-o", "--out", metavar="DIR", help="folder for results, noise_power.json and .png"),
        WRITES_FOLDER,
    ] = Path("out/noise-power"),
) -> None:
    """Measure accuracy, event rate and power of trained networks at several AFE noises, in both power modes."""
    from eskin.snn.figures.noise_power import plot_noise_power
    from eskin.snn.studies.noise import MODES, points_of, under_noise
    from eskin.snn.studies.paired import paired

    noises_v = [1e-3 * number for number in _numbers(noises)]
    check_device("cpu", 1)
    subjects = subjects_of(weights, scenes=False)
    names = two_of(pair, {subject.network for subject in subjects})
    out.mkdir(parents=True, exist_ok=True)
    with bar("scans", sum(len(subject.images) for subject in subjects)) as step:
        cells = under_noise(subjects, noises_v, out, step)
    points = points_of(subjects, cells)
    pairs = paired(points, names[0], names[1], ("mode", "noise_v")) if names else []
    write_json(out / "noise_power.json", origin(command_line(context)) | {"points": points, "pairs": pairs})
    plot_noise_power(points, out / "noise_power.png")
    for mode in MODES:
        _print_noise([point for point in points if point["mode"] == mode], mode)
    for one in pairs:
        counts = f"only {one['first']} right {one['only_first']}, only {one['second']} {one['only_second']}"
        print(f"{one['mode']}, {1e3 * one['noise_v']:g} mV: {counts} of {one['images']}, McNemar p {one['p']:.2g}")
    print(printable(f"result: {out / 'noise_power.json'}, picture: {out / 'noise_power.png'}"))


def two_of(text: str | None, known: Collection[str]) -> list[str]:
    """Return the names of the two networks to compare, or an empty list without ``--pair``."""
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


def _print_noise(points: list[dict[str, Any]], mode: str) -> None:
    from eskin.base.units import with_unit

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


NOISE = {"points": [{"mode": str, "network": str, "noise_v": float, "accuracy": float, "bootstrap_95": [float]}]}
"""What merits needs of a noise study."""


def merits(
    context: typer.Context,
    weights: Annotated[
        list[Path] | None,
        typer.Argument(metavar="DIR...", help="folders NETWORK/TRAINING/ of eskin train, for the latency [none]"),
    ] = None,
    pair: Pair = None,
    noise: Annotated[
        Path | None, typer.Option(metavar="FILE", help="noise_power.json to include in the figure")
    ] = None,
    dataset: DatasetName = None,
    limit: Annotated[int, typer.Option(min=1, help="number of textures for rest and timing, evenly spread")] = 24,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="merits.json and .png"), WRITES_FOLDER] = Path(
        "out/merits"
    ),
) -> None:
    """Compare events and frames by latency, data rate at rest, noise and timing error."""
    from eskin.skin.textures.dataset import open_dataset
    from eskin.snn.figures.merits import plot_merits
    from eskin.snn.studies.merits import rest_and_timing

    out.mkdir(parents=True, exist_ok=True)
    result: dict[str, Any] = dict(origin(command_line(context)))
    result["latency"], result["latency_pairs"] = _latency(weights or [], pair)
    result |= rest_and_timing(open_dataset(dataset).limit(limit), bar)
    result["noise"] = read_shaped(noise, "the noise study", NOISE)["points"] if noise is not None else []
    write_json(out / "merits.json", result)
    plot_merits(result, out / "merits.png")
    _print_merits(result)
    print(printable(f"result: {out / 'merits.json'}, picture: {out / 'merits.png'}"))


def _latency(weights: list[Path], pair: str | None) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    if not weights:
        if pair is not None:
            raise InputError("--pair compares trained networks; name their folders")
        return [], []
    from eskin.snn.studies.latency import latency_points
    from eskin.snn.studies.paired import paired

    check_device("cpu", 1)
    subjects = subjects_of(weights, scenes=False)
    names = two_of(pair, {subject.network for subject in subjects})
    with bar("latency", len(subjects) * len(TIMES_MS)) as step:
        points = latency_points(subjects, [1e-3 * time for time in TIMES_MS], step)
    return points, paired(points, names[0], names[1], ("time_s",)) if names else []


def _print_merits(result: dict[str, Any]) -> None:
    for point in result["latency"]:
        print(f"{point['network']}: {1e3 * point['time_s']:.0f} ms, {point['accuracy']:.1%} of {point['images']}")
    for one in result["latency_pairs"]:
        counts = f"only {one['first']} right {one['only_first']}, only {one['second']} {one['only_second']}"
        print(f"{1e3 * one['time_s']:.0f} ms: {counts}, McNemar p {one['p']:.2g}")
    for one in result["rest"]:
        rates = f"{one['sent_bps'] / 1e3:.4g} kb/s, coded {one['coded_bps'] / 1e3:.4g} kb/s"
        print(f"{one['readout']} {one['phase']} at {1e3 * one['noise_v']:g} mV: {rates}")
    for one in result["timing"]:
        errors = f"median {1e6 * one['median_s']:.0f} us, 95 % below {1e6 * one['p95_s']:.0f} us"
        print(f"{one['known_from']} {one['rate_hz']:g} Hz: found {one['found']:.1%}, {errors}")


def precision(
    context: typer.Context,
    weights: Trainings = None,
    variants: Annotated[
        str,
        typer.Option(metavar="BITS[:tN][:mN],...", help="bits of weights, of the threshold, of a hidden potential"),
    ] = VARIANTS,
    out: Annotated[
        Path,
        typer.Option("-o", "--out", metavar="DIR", help="folder for results, precision.json and .png"),
        WRITES_FOLDER,
    ] = Path("out/precision"),
) -> None:
    """Measure the accuracy of trained networks after quantisation to few bits."""
    from eskin.snn.figures.precision import plot_precision
    from eskin.snn.studies.precision import in_precisions, parse_variants, points_of, tests_of

    asked = parse_variants(variants)
    check_device("cpu", 1)
    subjects = subjects_of(weights, scenes=False)
    out.mkdir(parents=True, exist_ok=True)
    with bar("networks", len(subjects)) as step:
        cells = in_precisions(subjects, asked, out, step)
    points = points_of(cells)
    result = origin(command_line(context)) | {"tests": tests_of(cells), "points": points}
    write_json(out / "precision.json", result)
    plot_precision(points, out / "precision.png")
    _print_precision(points)
    print(printable(f"result: {out / 'precision.json'}, picture: {out / 'precision.png'}"))


def _print_precision(points: list[dict[str, Any]]) -> None:
    table = new_table(("network", "bits", "accuracy", "95 % interval", "memory", "as in float"), left=(0, 1))
    for point in points:
        low, high = point["bootstrap_95"]
        table.add_row(
            printable(point["network"]),
            point["variant"],
            f"{100 * point['accuracy']:.1f}",
            f"{100 * low:.0f} to {100 * high:.0f}",
            f"{point['memory_bits'] / 8000:.1f} kB" if "memory_bits" in point else "",
            f"{100 * point['within']:.0f}",
        )
    show(table)
