"""Plot the frontier: accuracy against data rate, one panel per scan and network."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.base.figures.labels import Box, Taken, on_page, place_label
from eskin.base.figures.style import GREY, dress, legend_below, new_figure, save_figure
from eskin.base.units import counted
from eskin.skin.figures.readouts import look
from eskin.snn.figures.fig9 import NAMES, RECEIVED, Data

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NETWORKS = {
    "leaky": "128 leaky neurons",
    "leaky-2ms": "128 leaky neurons, bins of 2 ms",
    "convolutions": "1-D convolutions",
    "paper": "the paper's network",
}
"""Networks of the frontier in words."""

COLUMNS = 3
"""Panels side by side."""

LEGEND = "bars: 95 % interval over images and seeds; thin line: to the rate after lossless coding (events: with times)"


def kind_of(point: Data) -> str:
    """Return the encoder of a point, or ``frame``."""
    name = str(point["readout"]).partition(":")[0]
    return "frame" if name.startswith("frame") else name


def words_of(point: Data) -> str:
    """Return bits (or frame rate and bits) and number of taxels of a point as text."""
    kind, *numbers = str(point["readout"]).split(":")
    words = f"{numbers[0]} b"
    if kind.startswith("frame"):
        levels = f", levels of {numbers[2]} b" if len(numbers) > 2 else ""
        words = f"{RECEIVED.get(kind.removeprefix('frame-'), '')}{numbers[0]} Hz {numbers[1]} b{levels}"
    return f"{words}, {counted(len(point['taxels']), 'taxel')}"


def plot_frontier(data: Data, path: Path) -> None:
    """Plot accuracy against data rate to a file; see :func:`draw_frontier`."""
    save_figure(draw_frontier(data), path)


def draw_frontier(data: Data) -> Figure:
    """Return a figure of accuracy against data rate, one panel per scan and network."""
    from matplotlib.lines import Line2D

    of_panels: dict[tuple[str, str], list[Data]] = {}
    for point in data["points"]:
        of_panels.setdefault((point["preset"], point["network"]), []).append(point)
    rows, columns = -(-len(of_panels) // COLUMNS), min(COLUMNS, len(of_panels))
    figure = new_figure(2.0 + 4.2 * columns, 0.8 + 3.9 * rows, "Readouts of chosen taxels: accuracy against data rate")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for empty in grid.ravel()[len(of_panels) :]:
        empty.set_axis_off()
    panels = dict(zip(of_panels, grid.ravel(), strict=False))
    for (preset, network), panel in panels.items():
        dress(panel, f"{preset} scan, {NETWORKS[network]}", "bits/s", "accuracy (%)")
        panel.set_xscale("log")
        panel.tick_params(labelbottom=True)
    rates = [point[name] for point in data["points"] for name in ("bits_per_s", "coded_bits_per_s")]
    grid[0][0].set_xlim(0.8 * min(rates), 2 * max(rates))
    grid[0][0].set_ylim(40, 102)
    there = {kind_of(point) for point in data["points"]}
    shown = [readout for readout in NAMES if readout in there]
    keys = [Line2D([], [], color=look(r).colour, marker=look(r).marker, ls="") for r in shown]
    legend_below(figure, (keys, [NAMES[r] for r in shown]), len(keys), f"last epoch; {LEGEND}")
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for key, panel in panels.items():
        _draw_points(panel, of_panels[key])
    return figure


def _draw_points(panel: Axes, points: list[Data]) -> None:
    """Draw markers with intervals and compressed rates, then their labels."""
    taken, boxes = Taken(), []
    for point in points:
        at, middle, coded = point["bits_per_s"], 100 * point["accuracy"], point["coded_bits_per_s"]
        low, high = (100 * end for end in point["interval"])
        style: dict[str, Any] = {"color": look(kind_of(point)).colour, "alpha": 0.75, "zorder": 1.5, "lw": 1}
        panel.plot(at, middle, marker=look(kind_of(point)).marker, ms=7, ls="", color=style["color"])
        panel.plot([at, at], [low, high], marker="_", ms=5, **style)
        panel.plot([coded, at], [middle, middle], marker="|", ms=6, **style)
        (x, y), (bottom, top) = on_page(panel, at, middle), (on_page(panel, at, end)[1] for end in (low, high))
        ends = sorted((x, on_page(panel, coded, middle)[0]))
        box = Box(x - 3.5, min(bottom, y - 3.5), x + 3.5, max(top, y + 3.5))
        taken.boxes += [box, Box(ends[0] - 1, y - 3, ends[1] + 1, y + 3)]
        boxes.append((point, box))
    for point, box in boxes:
        label = panel.annotate(words_of(point), (point["bits_per_s"], 100 * point["accuracy"]), xytext=(0, 0),
                               textcoords="offset points", fontsize=7, color=look(kind_of(point)).colour,
                               arrowprops={"arrowstyle": "-", "lw": 0.6, "color": GREY})  # fmt: skip
        place_label(panel, label, box, taken, "right above below left")
