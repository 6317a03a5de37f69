"""Draw readouts at equal data rate, one panel per network: Fig. 9 with frames at the same rates."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.base.figures.labels import Box, Taken, on_page, place_label
from eskin.base.figures.style import GREY, dress, new_figure, save_figure
from eskin.skin.figures.readouts import look
from eskin.snn.experiments.pairs import pair
from eskin.snn.experiments.points import READINGS, PointSummary, Sweep
from eskin.snn.experiments.sweep import PUBLISHED_BPS
from eskin.snn.figures.fig9 import NAMES, Data, detail, own_point, partial

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NETWORKS = {"rates-cnn": "1-D convolutions", "rates-paper": "the paper's network", "rates-tuned": "leaky network"}
"""What is trained in the sweeps of equal rates, by their names."""

BEST = "best network of each readout"
AS_EQUAL = 1.6
"""Rates of two points that are compared differ by less than this factor."""

LOSSLESS = ("events", "samples", "differences")
"""What is coded of which the whole stream follows; addresses alone have lost the times."""

LEGEND = "bars: 95 % interval over images and seeds\nthin line to the left: the rate after lossless coding"


def rates_data(sweeps: Sequence[Sweep], reading: str) -> Data:
    """Return the points of all networks, and the pairs of frames and events of about equal rate, compared by image."""
    points, pairs = [], []
    for sweep in sweeps:
        measured = [point for point in sweep.points if point.measured]
        points += [
            own_point(sweep, point, reading) | {"coded_rate": coded_rate(point), "seeds": point.cells.whole_seeds}
            for point in measured
        ]
        for first in measured:
            for second in measured:
                if first.readout != "frame" and second.readout == "frame" and _as_equal(first, second):
                    pairs.append(_pair(sweep, first, second, reading))
    return {
        "commands": {sweep.name: sweep.command for sweep in sweeps},
        "networks": {sweep.name: NETWORKS.get(sweep.name, sweep.name) for sweep in sweeps},
        "reading": reading,
        "protocol": READINGS[reading],
        "reference_bps": PUBLISHED_BPS,
        "points": points,
        "pairs": [one for one in pairs if one],
    }


def coded_rate(point: PointSummary) -> float | None:
    """Return the smallest normalised rate after lossless coding, if measured."""
    found = [bps for name, bps in (point.coded_bps or {}).items() if name in LOSSLESS]
    return min(found) / PUBLISHED_BPS if found else None


def _as_equal(first: PointSummary, second: PointSummary) -> bool:
    assert first.normalised_rate
    assert second.normalised_rate
    return abs(math.log(first.normalised_rate / second.normalised_rate)) < math.log(AS_EQUAL)


def _pair(sweep: Sweep, first: PointSummary, second: PointSummary, reading: str) -> Data:
    """Return the comparison of events and frames, or None without predictions."""
    if not (first.result(reading).predictions and second.result(reading).predictions):
        return {}
    found = dataclasses.asdict(pair(first, second, reading))
    return {"first": f"{sweep.name}:{first.name}", "second": f"{sweep.name}:{second.name}", **found}


def best_points(points: list[Data]) -> list[Data]:
    """Return the most accurate point of every readout and rate."""
    best: dict[tuple[str, float], Data] = {}
    for point in points:
        key = (point["readout"], point["normalised_rate"])
        if key not in best or point["accuracy"] > best[key]["accuracy"]:
            best[key] = point
    return list(best.values())


# -- picture -----------------------------------------------------------------------------------------


def plot_rates(data: Data, path: Path) -> None:
    """Draw accuracy against data rate; see :func:`draw_rates`."""
    save_figure(draw_rates(data), path)


def draw_rates(data: Data) -> Figure:
    """Return accuracy against normalised data rate, one panel for each network and one for the best of each readout."""
    from matplotlib.lines import Line2D
    from matplotlib.ticker import LogLocator, NullFormatter

    of_panels = {words: [p for p in data["points"] if p["sweep"] == name] for name, words in data["networks"].items()}
    of_panels = {words: points for words, points in of_panels.items() if points}
    if len(of_panels) > 1:
        of_panels[BEST] = best_points(data["points"])
    figure = new_figure(2.6 + 3.6 * len(of_panels), 4.6, "Readouts at equal data rate")
    panels = figure.subplots(1, len(of_panels), sharex=True, sharey=True, squeeze=False)[0]
    rates = [p[key] for p in data["points"] for key in ("normalised_rate", "coded_rate") if p[key]]
    for panel, words in zip(panels, of_panels, strict=True):
        dress(panel, words)
        panel.set_xscale("log")
        panel.set_xlabel(f"data rate / ({data['reference_bps'] / 1e3:g} kb/s)", fontsize=8.5)
        panel.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        panel.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
        panel.xaxis.set_minor_formatter(NullFormatter())
    panels[0].set_xlim(0.6 * min(rates), 2.5 * max(rates))
    panels[0].set_ylim(40, 102)
    panels[0].set_ylabel("accuracy (%)", fontsize=8.5)
    there = {point["readout"] for point in data["points"]}
    keys = [
        Line2D([], [], color=look(r).colour, marker=look(r).marker, ls="", label=NAMES[r]) for r in NAMES if r in there
    ]
    seeds = sorted({point["seeds"] for point in data["points"]})
    words = f"{data['protocol']}, seeds: {' or '.join(map(str, seeds))}\n{LEGEND}"
    legend = figure.legend(handles=keys, loc="outside lower left", ncols=len(keys), title=words, title_fontsize=8,
                           fontsize=8, frameon=False, alignment="left")  # fmt: skip
    legend.get_title().set_color(GREY)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for panel, points in zip(panels, of_panels.values(), strict=True):
        _draw_points(panel, points)
    return figure


def _draw_points(panel: Axes, points: list[Data]) -> None:
    """Draw marks with bars and coded rates, then the labels beside them."""
    taken, boxes = Taken(), []
    for point in points:
        colour, at, middle = look(point["readout"]).colour, point["normalised_rate"], 100 * point["accuracy"]
        low, high = (100 * end for end in point["interval"])
        style: dict[str, Any] = {"color": colour, "lw": 1}
        panel.plot(at, middle, marker=look(point["readout"]).marker, ms=7, ls="", color=colour,
                   fillstyle="none" if partial(point) else "full")  # fmt: skip
        panel.plot([at, at], [low, high], marker="_", ms=5, alpha=0.75, zorder=1.5, **style)
        x, y = on_page(panel, at, middle)
        left = x
        if point["coded_rate"]:
            panel.plot([point["coded_rate"], at], [middle, middle], marker="|", ms=6, alpha=0.75, zorder=1.5, **style)
            left = on_page(panel, point["coded_rate"], middle)[0]
        ends = [on_page(panel, at, end)[1] for end in (low, high)]
        box = Box(x - 3.5, min(ends[0], y - 3.5), x + 3.5, max(ends[1], y + 3.5))
        taken.boxes += [box, Box(min(left, x - 3.5) - 1, y - 3, x, y + 3)]
        boxes.append((point, box))
    for point, box in boxes:
        place, colour = (point["normalised_rate"], 100 * point["accuracy"]), look(point["readout"]).colour
        label = panel.annotate(detail(point), place, xytext=(0, 0), textcoords="offset points", fontsize=7,
                               color=colour)  # fmt: skip
        place_label(panel, label, box, taken, "right above below left")
