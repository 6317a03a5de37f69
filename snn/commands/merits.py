"""The command merits (docs/results/what_events_are_good_for.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from model.cli.app import printable
from model.cli.progress import bar
from model.errors import InputError
from model.files import check_writable, read_json, write_json
from snn.commands.noise_power import Pair, two_of
from snn.commands.options import DatasetName, check_device
from snn.commands.robustness import trained_files
from snn.commands.sweep import command_line

TIMES_MS = (10, 14, 18, 22, 26, 30, 40, 50, 70, 100, 150, 200, 300, 398)
NOISES_V = (0.0, 1e-3, 3e-3, 1e-2)
FRAMES_HZ = (250.0, 500.0, 1000.0, 5000.0, 20000.0)


def merits(
    context: typer.Context,
    weights: Annotated[
        list[Path] | None,
        typer.Argument(metavar="DIR...", help="folders NETWORK/TRAINING/ of snn train, for the latency; [none]"),
    ] = None,
    pair: Pair = None,
    noise: Annotated[Path | None, typer.Option(metavar="FILE", help="noise_power.json, to be drawn beside")] = None,
    dataset: DatasetName = None,
    limit: Annotated[int, typer.Option(min=1, help="textures, evenly spread, of rest and timing")] = 24,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="merits.json and .png")] = Path("out/merits"),
) -> None:
    """What events and frames are good for: latency of the answer, bits at rest, noise, and timing precision."""
    from model.config import ReadoutConfig
    from model.textures.dataset import open_dataset
    from snn.data.frame_steps import FrameSteps
    from snn.figures.merits import plot_merits
    from snn.studies.rest import bits_per_second
    from snn.studies.timing import timing_points

    out.mkdir(parents=True, exist_ok=True)
    for name in ("merits.json", "merits.png"):
        check_writable(out / name)
    result: dict[str, Any] = {"command": command_line(context)}
    result["latency"], result["latency_pairs"] = _latency(weights or [], pair)
    textures = open_dataset(dataset).limit(limit)
    frames = FrameSteps(rate_hz=500.0, bits=6, frames_per_step=2)
    encoders = {"lcs:3": ("lcs", 3), "cw-lcs:3": ("cw-lcs", 3), "nlcs:6": ("nlcs", 6)}
    readouts: dict[str, Any] = {
        name: ReadoutConfig.from_dict({"encoding": encoding, "resolution": bits})
        for name, (encoding, bits) in encoders.items()
    }
    with bar("rest", len(textures) * (len(readouts) + 1)) as step:
        result["rest"] = bits_per_second(textures, readouts | {"frame:500:6": frames}, NOISES_V, step)
    with bar("timing", len(textures)) as step:
        rates = [FrameSteps(rate_hz=rate, bits=8, frames_per_step=1) for rate in FRAMES_HZ]
        result["timing"] = timing_points(textures, readouts["lcs:3"], rates, step)
    result["textures"] = len(textures)
    result["noise"] = read_json(noise, "the noise study", dict)["points"] if noise is not None else []
    write_json(out / "merits.json", result)
    plot_merits(result, out / "merits.png")
    _print(result)
    print(printable(f"result: {out / 'merits.json'}, picture: {out / 'merits.png'}"))


def _latency(weights: list[Path], pair: str | None) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    if not weights:
        if pair is not None:
            raise InputError("--pair compares trained networks; name their folders")
        return [], []
    from snn.experiments.robustness import Subject
    from snn.studies.latency import latency_points
    from snn.studies.paired import paired

    check_device("cpu", 1)
    subjects = [Subject.load(path, scenes=False) for path in trained_files(weights)]
    names = two_of(pair, {subject.network for subject in subjects})
    with bar("latency", len(subjects) * len(TIMES_MS)) as step:
        points = latency_points(subjects, [1e-3 * time for time in TIMES_MS], step)
    return points, paired(points, names[0], names[1], ("time_s",)) if names else []


def _print(result: dict[str, Any]) -> None:
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
