"""Fig. 9: sweeps in, data of the picture out, the picture made from those data."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from model.errors import InputError
from model.figures.style import GREY, READOUT_COLOURS, READOUT_MARKERS, dress, new_figure, save_figure
from model.files import read_json
from model.power.equations import READOUT_NAMES
from model.textures.presets import PRESETS
from snn.experiments.points import READINGS, PointSummary, Sweep, load_sweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

Data = dict[str, Any]

PUBLISHED = Path(__file__).with_name("published_fig9.json")
"""The points of the paper's Fig. 9; nowhere else."""

KEPT = Path(__file__).with_name("sweeps")
"""Sweeps that come with the project: copies of ``sweep.json``, each with a name of its own."""

LATEST = Path("out/sweep/sweep.json")
"""Where ``python -m snn sweep`` writes unless told otherwise."""

NAMES = READOUT_NAMES | {"cw-lcs": "CW-LCS"}
STYLES = (("-", "full"), ("--", "left"), ("-.", "bottom"), (":", "right"))
"""Line and filling of the marks of each sweep, in turn."""

PUBLISHED_NAME = "published"
BARS = "bars: 95 % interval over images and seeds; of published points, standard deviation over folds"


# -- sweeps ------------------------------------------------------------------------------------------


def load_sweeps(paths: Sequence[Path]) -> list[Sweep]:
    """Return the sweeps of some files or folders; without any, those that come with the project and the latest."""
    files = list(paths) or kept_sweeps() + ([LATEST] if LATEST.is_file() else [])
    if not files:
        raise InputError(f"there is no sweep in {KEPT}, nor {LATEST}; make one with python -m snn sweep")
    sweeps = [load_sweep(path) for path in files]
    names = [sweep.name for sweep in sweeps]
    if twice := [name for name in names if names.count(name) > 1]:
        raise InputError(f"two sweeps are called {twice[0]}; rename one of them")
    return sweeps


def kept_sweeps() -> list[Path]:
    """Return the files of the sweeps that come with the project."""
    return sorted(KEPT.glob("*.json"))


# -- Fig. 9, data ------------------------------------------------------------------------------------


def fig9_data(sweeps: Sequence[Sweep], reading: str) -> Data:
    """Return published and own points in the format of the report (docs/guide/report.md).

    Points without results are left out, and named in ``left_out``.
    """
    published = read_json(PUBLISHED, "the published points")
    points = [
        point
        | {
            "readout": f"{point['readout']}, {PUBLISHED_NAME}",
            "label": f"{NAMES[point['readout']]} {_detail_of(point)}, {PUBLISHED_NAME}",
            "sweep": PUBLISHED_NAME,
            "preset": published["preset"],
            "classes": published["classes"],
            "data_rate_bps": point["normalised_rate"] * published["reference_bps"],
        }
        for point in published["points"]
    ]
    left_out = []
    for sweep in sweeps:
        for point in sweep.points:
            if point.measured:
                points.append(own_point(sweep, point, reading))
            else:
                left_out.append(f"{sweep.name}: {point.name}")
    named: dict[str, list[str]] = {}
    for sweep in sweeps:
        named.setdefault(_protocol(sweep, reading), []).append(sweep.name)
    words = "; ".join(f"{', '.join(names)}: {protocol}" for protocol, names in named.items())
    return {
        "source": f"Published: {published['source']}. Here: {words}; intervals are of 95 %, over images and seeds.",
        "commands": {sweep.name: sweep.command for sweep in sweeps},
        "reading": reading,
        "protocol": list(named),
        "reference_bps": published["reference_bps"],
        "left_out": left_out,
        "points": points,
    }


def own_point(sweep: Sweep, point: PointSummary, reading: str) -> Data:
    """Return a point of a sweep as the figures take it; the interval is the one over images and seeds."""
    found, cells = point.result(reading), point.cells
    label = f"{NAMES[point.readout]} {_detail(point.readout, point.name, point.resolution)}, {sweep.name}"
    if point.preset not in (None, "paper") and str(point.preset) not in sweep.name:
        label += f", {point.preset}"
    if point.partial:
        label += f", {cells.done} of {cells.of} cells"
    return {
        "readout": point.readout,
        "label": label,
        "sweep": sweep.name,
        "name": point.name,
        "preset": point.preset,
        "resolution": point.resolution,
        "cells": dataclasses.asdict(cells),
        "data_rate_bps": point.data_rate_bps,
        "normalised_rate": point.normalised_rate,
        "classes": len(found.confusion),
        "accuracy": found.accuracy,
        "interval": found.bootstrap_95,
        **{key: getattr(found, key) for key in ("wilson_95", "sd_over_cells", "sd_over_folds", "sd_over_seeds")},
        "images": found.images,
    }


def partial(point: Data) -> bool:
    """Return whether cells of a drawn point are still to be run."""
    return "cells" in point and bool(point["cells"]["done"] < point["cells"]["of"])


def _detail(readout: str, name: str, resolution: int) -> str:
    """Return what tells the points of a readout apart: the resolution, or of frames the network."""
    name = name.removeprefix("frame").strip("-")
    return name if readout.startswith("frame") and name else f"{resolution} b"


def _detail_of(point: Data) -> str:
    return _detail(point["readout"], str(point.get("name", "")), point["resolution"])


def _protocol(sweep: Sweep, reading: str) -> str:
    """Return images, folds, seeds and epoch in words, as the finished points have them."""
    found = []
    for point in sweep.points:
        if point.measured and not point.partial:
            of, seeds = point.cells.of, point.cells.whole_seeds
            found.append(f"{point.result(reading).images} images, {of // seeds} folds x {seeds} seeds")
    return f"{' or '.join(dict.fromkeys(found)) or 'no point is finished'}, {READINGS[reading]}"


# -- Fig. 9, picture ---------------------------------------------------------------------------------


def plot_fig9(data: Data, path: Path) -> None:
    """Draw accuracy against data rate; see :func:`draw_fig9`."""
    save_figure(draw_fig9(data), path)


def draw_fig9(data: Data) -> Figure:
    """Return accuracy against normalised data rate, one panel for each preset.

    Published points are hollow, with their standard deviation over folds where it is known; own ones are filled,
    with the interval over images and seeds. Points of unfinished cross-validations are ringed.
    """
    from matplotlib.ticker import LogLocator, NullFormatter

    presets = [preset for preset in (*PRESETS, None) if any(point["preset"] == preset for point in data["points"])]
    sweeps = list(data["commands"])
    figure = new_figure(1.6 + 4.6 * len(presets), 5.2, "Accuracy against data rate")
    panels = figure.subplots(1, len(presets), sharex=True, sharey=True, squeeze=False)[0]
    for panel, preset in zip(panels, presets, strict=True):
        dress(panel, f"{preset} scan" if preset else "own recordings")
        points = [point for point in data["points"] if point["preset"] == preset]
        for sweep, readout, series in _series(points, [PUBLISHED_NAME, *sweeps]):
            _draw_series(panel, series, readout, _style(sweep, sweeps))
        _label_points(panel, points)
        for classes in sorted({point["classes"] for point in points}):
            panel.axhline(100 / classes, color=GREY, lw=0.9, ls=(0, (1, 2)), zorder=0)
            panel.text(0.005, 100 / classes + 0.8, "chance", fontsize=7.5, color=GREY,
                       transform=panel.get_yaxis_transform())  # fmt: skip
        panel.set_xscale("log")
        panel.set_xlabel(f"data rate / ({data['reference_bps'] / 1e3:g} kb/s)", fontsize=8.5)
        panel.xaxis.set_major_locator(LogLocator(subs=(1, 3)))
        panel.xaxis.set_minor_locator(LogLocator(subs="all"))
        panel.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
        panel.xaxis.set_minor_formatter(NullFormatter())
    rates = [point["normalised_rate"] for point in data["points"]]
    panels[0].set_xlim(0.6 * min(rates), 2.2 * max(rates))
    panels[0].set_ylim(0, 108)
    panels[0].set_yticks(range(0, 101, 20))
    panels[0].set_ylabel("accuracy (%)", fontsize=8.5)
    legend = figure.legend(handles=_keys(data, sweeps), loc="outside lower left", ncols=3 + 2 * len(presets),
                           title="\n".join([*data["protocol"], BARS]), title_fontsize=8, fontsize=8, frameon=False,
                           alignment="left", columnspacing=1.4)  # fmt: skip
    legend.get_title().set_color(GREY)
    return figure


def _series(points: list[Data], sweeps: list[str]) -> Iterator[tuple[str, str, list[Data]]]:
    """Give the points of every sweep and readout, by rising data rate."""
    for sweep in sweeps:
        for readout in NAMES:
            chosen = [p for p in points if p["sweep"] == sweep and p["readout"].split(",")[0] == readout]
            if chosen:
                yield sweep, readout, sorted(chosen, key=lambda p: p["normalised_rate"])


def _style(sweep: str, sweeps: list[str]) -> Data:
    """Return line and filling of a sweep; published points are hollow and thin."""
    if sweep == PUBLISHED_NAME:
        return {"ls": "-", "lw": 0.7, "fillstyle": "none", "ms": 6, "zorder": 1.8}
    line, filling = STYLES[sweeps.index(sweep) % len(STYLES)]
    return {"ls": line, "lw": 1.5, "fillstyle": filling, "ms": 7, "markerfacecoloralt": "white", "zorder": 2}


def _draw_series(panel: Axes, points: list[Data], readout: str, style: Data) -> None:
    """Draw points with their bars, joined by a line; frames, which differ in more than the rate, are not joined."""
    if readout == "frame":
        style = style | {"ls": ""}
    x, y = ([p["normalised_rate"] for p in points], [100 * p["accuracy"] for p in points])
    panel.plot(x, y, color=READOUT_COLOURS[readout], marker=READOUT_MARKERS[readout], **style)
    for point in points:
        at, ends = point["normalised_rate"], _ends(point)
        if ends[1] > ends[0]:
            caps = 11 if point["sweep"] == PUBLISHED_NAME else 5  # a published bar shows beside one of the same rate
            panel.plot([at, at], [100 * end for end in ends], color=READOUT_COLOURS[readout], lw=style["lw"],
                       marker="_", ms=caps, mew=style["lw"], alpha=0.75, zorder=1.5)  # fmt: skip
        if partial(point):
            panel.plot(at, 100 * point["accuracy"], "o", ms=15, mfc="none", mec=GREY, mew=1)


def _ends(point: Data) -> tuple[float, float]:
    """Return the ends of a bar: the interval, else the standard deviation over folds, else the point itself."""
    if "interval" in point:
        low, high = point["interval"]
        return low, high
    deviation = point.get("sd_over_folds", 0.0)
    return point["accuracy"] - deviation, point["accuracy"] + deviation


def _label_points(panel: Axes, points: list[Data]) -> None:
    """Name every resolution once, above the highest (LCS) or below the lowest of its points, and networks on frames."""
    from matplotlib.patheffects import withStroke

    halo = [withStroke(linewidth=2, foreground="white")]
    groups: dict[tuple[str, str], list[Data]] = {}
    for point in points:
        readout = point["readout"].split(",")[0]
        if readout != "frame":
            groups.setdefault((readout, _detail_of(point)), []).append(point)
    for (readout, text), group in groups.items():
        side = 1 if readout == "lcs" else 0
        outer: Data = (max if side else min)(group, key=lambda point: _ends(point)[side])
        place = _ends(outer)[side]
        gap = 7 if place == outer["accuracy"] else 3  # clear of the mark, or of the bar's end
        panel.annotate(text, (outer["normalised_rate"], 100 * place), xytext=(2, gap) if side else (4, -gap),
                       textcoords="offset points", ha="right" if side else "left", va="bottom" if side else "top",
                       fontsize=7.5, color=READOUT_COLOURS[readout], path_effects=halo)  # fmt: skip
    lowest = -math.inf
    for point in sorted((p for p in points if p["readout"].startswith("frame")), key=lambda p: p["accuracy"]):
        lowest = max(100 * point["accuracy"], lowest + 3.5)  # no label on another
        panel.annotate(_detail_of(point), (point["normalised_rate"], lowest), xytext=(7, 0), textcoords="offset points",
                       va="center", fontsize=7.5, color=READOUT_COLOURS["frame"], path_effects=halo)  # fmt: skip


def _keys(data: Data, sweeps: list[str]) -> list[Line2D]:
    """Return the legend: readouts by colour and mark, sweeps by line and filling."""
    from matplotlib.lines import Line2D

    there = {point["readout"].split(",")[0] for point in data["points"]}
    keys = [
        Line2D([], [], color=READOUT_COLOURS[r], marker=READOUT_MARKERS[r], ls="", label=NAMES[r])
        for r in NAMES
        if r in there
    ]
    for sweep in (PUBLISHED_NAME, *sweeps):
        keys.append(Line2D([], [], color=GREY, marker="o", label=sweep, **_style(sweep, sweeps)))
    if any(partial(point) for point in data["points"]):
        keys.append(Line2D([], [], ls="", marker="o", ms=11, mfc="none", mec=GREY, label="not all cells finished"))
    return keys
