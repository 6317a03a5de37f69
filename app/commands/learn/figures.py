"""The commands fig8, fig9, pair and frontier: results of trained networks (docs/guide/classifier.md)."""

import dataclasses
from pathlib import Path
from typing import Any

from eskin.app.cli import echo
from eskin.app.commands import common
from eskin.app.commands.learn.options import Seeds, check_device
from eskin.app.commands.signals.recordings import named_place
from eskin.app.options import TRAINED, arg, opt, out_file, out_folder
from eskin.app.tables import filled
from eskin.base.errors import InputError
from eskin.base.files import write_json
from eskin.base.progress import bar
from eskin.base.shapes import read_shaped
from eskin.snn.experiments.pairs import find_point
from eskin.snn.experiments.pairs import pair as compare
from eskin.snn.experiments.points import READINGS, load_sweep
from eskin.snn.figures.fig9 import KEPT, fig9_data, load_sweeps


def fig9(
    sweep: list[Path] | None = opt(
        None, "FILE|DIR", "sweep, repeatable [those of the project and out/sweep/sweep.json]"
    ),
    reading: str = opt("last", "last|selected", "epoch to evaluate"),
    confusion: str | None = opt(
        None, "NAME", "sweep points for confusion matrices [best spiking point of each preset]"
    ),
    out: common.Out = common.DEFAULT_OUT,
    data_out: common.DataOut = None,
) -> None:
    """Plot figure 9, accuracy against data rate with published points, and confusion matrices."""
    from eskin.snn.figures.confusion import confusion_data, plot_confusion
    from eskin.snn.figures.fig9_plot import plot_fig9

    if reading not in READINGS:
        raise InputError(f"reading must be one of {', '.join(READINGS)}, not {reading!r}")
    sweeps = load_sweeps(sweep or [])
    matrices = confusion_data(sweeps, reading, confusion)
    data = fig9_data(sweeps, reading)
    common.store(out, "fig9", data, plot_fig9, data_out)
    if matrices["points"]:
        common.store(out, "confusion", matrices, plot_confusion, data_out)
    for point in data["left_out"]:
        echo(f"left out, because no seed is finished: {point}")


def fig8(
    weights: Path = opt(TRAINED, "FILE", "weights from eskin train"),
    result: Path | None = opt(None, "FILE", "result of the same training [result.json beside the weights]"),
    dataset: str | None = opt(None, "DIR|embedded", "textures [folder used in training]"),
    data: Path | None = opt(
        None, "DIR|finger", "your own recordings, if the network was trained on them", callback=named_place
    ),
    image: str | None = opt(None, "NAME", "texture or recording, such as brick/brick-00 [first correct test image]"),
    out: common.Out = common.DEFAULT_OUT,
    data_out: common.DataOut = None,
) -> None:
    """Plot figure 8: one scan from texture through events and hidden spikes to the evidence of each class."""
    from eskin.skin.figures.scan_to_class import plot_scan
    from eskin.snn.figures.fig8_play import play

    if dataset is not None and data is not None:
        raise InputError("--dataset is for textures, --data for your own recordings; give one of the two")
    played = play(weights, result or weights.parent / "result.json", dataset, data, image)
    common.store(out, "fig8", played.to_dict(), lambda _, path: plot_scan(played, path), data_out)
    echo(f"{played.name}: true {played.true}, predicted {played.predicted}")
    if played.tests:
        noun = "recordings" if played.pixels is None else "images"
        print(f"the network is right for {played.right} of {played.tests} test {noun}")


POINT = "SWEEP:POINT, such as rates-cnn:lcs-4; SWEEP is a file or a sweep of the project"


def pair(
    first: str = arg(..., "A", POINT),
    second: str = arg(..., "B", "SWEEP:POINT to compare with"),
    reading: str = opt("last", "last|selected", "epoch to evaluate"),
    out: Path | None = out_file(None, "FILE", "JSON file for the results"),
) -> None:
    """Compare the predictions of two sweep points image by image with McNemar's exact test."""
    if reading not in READINGS:
        raise InputError(f"reading must be one of {', '.join(READINGS)}, not {reading!r}")
    found = compare(find_point(first, KEPT), find_point(second, KEPT), reading)
    echo(f"A: {first}, B: {second}, {READINGS[reading]}, {found.images} images")
    rows = zip(found.accuracy_first, found.accuracy_second, found.only_first, found.only_second, found.p, strict=True)
    for seed, (a, b, only_a, only_b, p) in enumerate(rows):
        print(f"seed {seed}: A {a:.1%}, B {b:.1%}; only A right {only_a}, only B right {only_b}, McNemar p {p:.2g}")
    low, high = found.interval
    print(
        f"B - A: {100 * found.difference:+.1f} points, 95 % interval over images and seeds {100 * low:+.1f} to "
        f"{100 * high:+.1f}"
    )
    if out is not None:
        write_json(out, {"first": first, "second": second, "reading": reading} | dataclasses.asdict(found))
        echo(f"result: {out}")


def frontier(
    points: list[str] | None = arg(
        None, "POINT...", "PRESET/NETWORK/READOUT/TAXELS, such as physical/leaky/lcs:3/across:4 [all documented points]"
    ),
    seeds: Seeds = 1,
    device: str = opt("cpu", "device name of torch; a GPU trains the convolutional networks of a point together"),
    inner: int | None = opt(
        None, "FOLDS", "compare the points only on inner validation images of this many folds", min=1, max=6
    ),
    draw: Path | None = opt(None, "FILE", "plot this frontier.json without training"),
    dataset: common.Textures = None,
    out: Path = out_folder(Path("out/frontier"), "DIR", "folder for results, frontier.json and .png"),
) -> None:
    """Train networks on chosen taxels, and compare accuracy with events/s, bits/s and power.

    Without POINT, inner validation chooses a readout of every encoder, and frames, at every event rate. A stopped run
    continues with the missing trainings.
    """
    from eskin.snn.figures.frontier import plot_frontier
    from eskin.snn.studies import frontier as study

    out.mkdir(parents=True, exist_ok=True)
    if draw is not None:
        if points or inner is not None:
            raise InputError("--draw draws a finished file; leave points and --inner out")
        plot_frontier(read_shaped(draw, "the frontier", study.SHAPE), out / "frontier.png")
        echo(f"wrote {out / 'frontier.png'}")
        return
    if inner is not None and not points:
        raise InputError("--inner needs points, such as physical/leaky/lcs:3/across:4")
    named = [study.Point.parse(text) for text in points or ()]
    check_device(device, 1)
    run = study.Frontier(out / "frontier.json", dataset, device)
    made: list[dict[str, Any]] = []
    validated: list[dict[str, Any]] = []
    with bar("cells", (inner or study.FOLDS * seeds) * len(named) if named else None) as step:
        if not named:
            made, validated = study.measured(run, step)
        elif inner is not None:
            validated = [run.inner(point, inner, step) for point in named]
        else:
            made = [run.point(point, seeds, step) for point in named]
    for one in validated:
        echo(f"{one['name']}: {100 * one['accuracy']:.1f} % in inner validation of {one['folds']} folds")
    if inner is not None:
        return
    for name, network in ({} if points else study.SWEEPS).items():
        made += study.points_of(load_sweep(KEPT / f"{name}.json"), network)
    data = study.frontier_data(made, validated)
    line = "{name}: {accuracy:100*.1f} % ({interval[0]:100*.1f} to {interval[1]:100*.1f}), seeds: {seeds}; "
    line += "{rate_hz:,.0f} events or values/s, {bits_per_s:,.0f} bits/s"
    for point in data["points"]:
        echo(filled(line, point))
    common.store(out, "frontier", data, plot_frontier)
