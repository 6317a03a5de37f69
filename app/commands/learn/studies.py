"""The commands robustness, noise-power, merits and precision for trained networks (docs/guide/robustness.md)."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from eskin.app.cli import command_line, echo
from eskin.app.commands import common
from eskin.app.commands.common import write_results
from eskin.app.commands.learn.options import check_device
from eskin.app.options import arg, opt, out_folder
from eskin.app.tables import filled, print_table
from eskin.base.errors import InputError
from eskin.base.progress import bar
from eskin.base.shapes import read_shaped

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


NOISES_MV = "0.1,1,3,10,20"
VARIANTS = "8,7,6,5,4,3,2,8:t6,8:t4,4:t6,4:t4,4:m16,4:m13,4:m11"
TIMES_MS = (10, 14, 18, 22, 26, 30, 40, 50, 70, 100, 150, 200, 300, 398)

ONLY_RIGHT = "only {first} right {only_first}, only {second} {only_second}"
MERITS = {
    "latency": "{network}: {time_s:1e3*.0f} ms, {accuracy:.1%} of {images}",
    "latency_pairs": f"{{time_s:1e3*.0f}} ms: {ONLY_RIGHT}, McNemar p {{p:.2g}}",
    "rest": "{readout} {phase} at {noise_v:1e3*g} mV: {sent_bps:1e-3*.4g} kb/s, coded {coded_bps:1e-3*.4g} kb/s",
    "timing": "{known_from} {rate_hz:g} Hz: found {found:.1%}, median {median_s:1e6*.0f} us, "
    "95 % below {p95_s:1e6*.0f} us",
}
"""Printed line for each result of merits, by part."""

Pair = Annotated[str | None, opt(..., "A,B", "two networks to compare image by image")]


def robustness(
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
    with common.resumable(out), bar("cells", len(subjects) * len(chosen)) as step:
        cells = run_cells(subjects, chosen, out, step)
    points = summarise(cells)
    written = write_results(out, "robustness", {"points": points}, plot_robustness, command=command_line())
    _print_robustness(points)
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
    found = []
    for place in places:
        below = sorted(place.rglob("weights.npz")) if place.is_dir() else [place]
        if not below:
            raise InputError(f"there is no trained network in {place}; make one with eskin train")
        found += below
    return found


def _print_robustness(points: list[dict[str, Any]]) -> None:
    networks = sorted({point["network"] for point in points})
    rows: dict[tuple[str, float], list[str]] = {}
    for point in points:
        name, strength = point["disturbance"], point["strength"]
        first = [name, "" if name == "clean" else f"{strength:g}", *[""] * len(networks), f"{point['rate_hz']:.0f}"]
        cell = filled("{accuracy:100*.1f} ({bootstrap_95[0]:100*.0f} to {bootstrap_95[1]:100*.0f})", point)
        rows.setdefault((name, strength), first)[2 + networks.index(point["network"])] = cell
    heads = ["disturbance", "strength", *networks, "events/s"]
    print_table(heads, rows.values(), title="accuracy in %, 95 % interval over images and seeds", left=(0, 1))


def noise_power(
    weights: Trainings = None,
    noises: str = opt(NOISES_MV, "MV,...", "AFE output noise v_n, mV rms of 1 V"),
    pair: Pair = None,
    out: Path = out_folder(Path("out/noise-power"), "DIR", "folder for results, noise_power.json and .png"),
) -> None:
    """Measure accuracy, event rate and power of trained networks at several AFE noises, in both power modes."""
    from eskin.snn.experiments.pairs import paired
    from eskin.snn.figures.merits import plot_noise_power
    from eskin.snn.studies.noise import MODES, points_of, under_noise

    noises_v = [1e-3 * number for number in _numbers(noises)]
    check_device("cpu", 1)
    subjects = subjects_of(weights, scenes=False)
    names = two_of(pair, {subject.network for subject in subjects})
    out.mkdir(parents=True, exist_ok=True)
    with bar("scans", sum(len(subject.images) for subject in subjects)) as step:
        cells = under_noise(subjects, noises_v, out, step)
    points = points_of(subjects, cells)
    pairs = paired(points, names[0], names[1], ("mode", "noise_v")) if names else []
    data = {"points": points, "pairs": pairs}
    written = write_results(out, "noise_power", data, plot_noise_power, command=command_line())
    for mode in MODES:
        print_table(
            "network | v_n | accuracy | 95 % interval | events/s | power",
            [point for point in points if point["mode"] == mode],
            "{network} | {noise_v:1e3*g} mV | {accuracy:100*.1f} | {bootstrap_95[0]:100*.0f} to "
            "{bootstrap_95[1]:100*.0f} | {rate_hz:.0f} | {power_w[total]:@W}",
            f"mode {mode}",
        )
    for one in pairs:
        line = f"{{mode}}, {{noise_v:1e3*g}} mV: {ONLY_RIGHT} of {{images}}, McNemar p {{p:.2g}}"
        echo(filled(line, one))
    echo(written)


def two_of(text: str | None, known: Collection[str]) -> list[str]:
    """Return the names of the two networks to compare, or an empty list without ``--pair``."""
    names = [name.strip() for name in text.split(",")] if text is not None else []
    if text is not None and (len(names) != 2 or not set(names) <= set(known)):
        raise InputError(f"--pair must be two of {', '.join(sorted(known))}, separated by a comma, not {text!r}")
    return names


def _numbers(text: str) -> list[float]:
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if not found or not all(0 < number < 1000 for number in found):
        raise InputError(f"--noises must be positive numbers of mV below 1000, separated by commas, not {text!r}")
    return found


NOISE = {"points": [{"mode": str, "network": str, "noise_v": float, "accuracy": float, "bootstrap_95": [float]}]}
"""Shape of the fields of a noise study that ``merits`` reads."""


def merits(
    weights: list[Path] | None = arg(
        None, "DIR...", "folders NETWORK/TRAINING/ of eskin train, for the latency [none]"
    ),
    pair: Pair = None,
    noise: Path | None = opt(None, "FILE", "noise_power.json to include in the figure"),
    dataset: common.Textures = None,
    limit: int = opt(24, "number of textures for rest and timing, evenly spread", min=1),
    out: Path = out_folder(Path("out/merits"), "DIR", "merits.json and .png"),
) -> None:
    """Compare events and frames by latency, data rate at rest, noise and timing error."""
    from eskin.skin.textures.dataset import open_dataset
    from eskin.snn.figures.merits import plot_merits
    from eskin.snn.studies.merits import rest_and_timing

    of_noise = read_shaped(noise, "the noise study", NOISE)["points"] if noise is not None else []
    out.mkdir(parents=True, exist_ok=True)
    result: dict[str, Any] = {}
    result["latency"], result["latency_pairs"] = _latency(weights or [], pair)
    result |= rest_and_timing(open_dataset(dataset).limit(limit), bar)
    result["noise"] = of_noise
    written = write_results(out, "merits", result, plot_merits, command=command_line())
    for part, line in MERITS.items():
        for one in result[part]:
            echo(filled(line, one))
    echo(written)


def _latency(weights: list[Path], pair: str | None) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    if not weights:
        if pair is not None:
            raise InputError("--pair compares trained networks; name their folders")
        return [], []
    from eskin.snn.experiments.pairs import paired
    from eskin.snn.studies.early import latency_points

    check_device("cpu", 1)
    subjects = subjects_of(weights, scenes=False)
    names = two_of(pair, {subject.network for subject in subjects})
    with bar("latency", len(subjects) * len(TIMES_MS)) as step:
        points = latency_points(subjects, [1e-3 * time for time in TIMES_MS], step)
    return points, paired(points, names[0], names[1], ("time_s",)) if names else []


def precision(
    weights: Trainings = None,
    variants: str = opt(VARIANTS, "BITS[:tN][:mN],...", "bits of weights, of the threshold, of a hidden potential"),
    out: Path = out_folder(Path("out/precision"), "DIR", "folder for results, precision.json and .png"),
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
    data = {"tests": tests_of(cells), "points": points}
    written = write_results(out, "precision", data, plot_precision, command=command_line())
    print_table(
        "network | bits | accuracy | 95 % interval | memory, kB | as in float",
        points,
        "{network} | {variant} | {accuracy:100*.1f} | {bootstrap_95[0]:100*.0f} to {bootstrap_95[1]:100*.0f}"
        " | {?memory_bits:1.25e-4*.1f} | {within:100*.0f}",
        left=(0, 1),
    )
    echo(written)
