"""Plot the frontier: accuracy against event rate, data rate and power, one column per scan and network."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from eskin.base.figures.style import dress, legend_below, new_figure, save_figure
from eskin.skin.figures.readouts import look
from eskin.snn.figures.fig9 import NAMES, Data
from eskin.snn.figures.networks import draw_accuracies

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

AXES = {"rate_hz": "events/s", "bits_per_s": "bits/s", "power_w": "power of the readout (W, 1 mV of noise)"}
"""Rows of panels: a field of the points, and its label. Frames have no event rate; some readouts have no power."""


def kind_of(point: Data) -> str:
    """Return the encoder of a point, or ``frame``."""
    name = str(point["readout"]).partition(":")[0]
    return "frame" if name.startswith("frame") else name


def plot_frontier(data: Data, path: Path) -> None:
    """Plot accuracy against rates and power to a file; see :func:`draw_frontier`."""
    save_figure(draw_frontier(data), path)


def draw_frontier(data: Data) -> Figure:
    """Return a figure of accuracy against event rate, data rate and power, one column per scan and network.

    If inner validation chose readouts, the figure shows only these.
    """
    from matplotlib.lines import Line2D

    chosen = {one["name"] for one in data["inner"] if one["chosen"]}
    points_shown = [point for point in data["points"] if not chosen or point["name"] in chosen]
    of_columns: dict[tuple[str, str], list[Data]] = {}
    for point in points_shown:
        of_columns.setdefault((point["preset"], point["network"]), []).append(point)
    figure = new_figure(1.0 + 3.0 * len(of_columns), 9.0, "Readouts of chosen taxels: accuracy against rate and power")
    grid = figure.subplots(len(AXES), len(of_columns), sharex="row", sharey=True, squeeze=False)
    for row, (field, label) in zip(grid, AXES.items(), strict=True):
        for panel, ((preset, network), points) in zip(row, of_columns.items(), strict=True):
            dress(panel, f"{preset} scan,\n{NETWORKS[network]}", label, "accuracy (%)" if panel is row[0] else "")
            panel.set_xscale("log")
            panel.set_ylim(20, 102)
            _draw(panel, points, field)
    there = {kind_of(point) for point in points_shown}
    shown = [readout for readout in NAMES if readout in there]
    keys = [Line2D([], [], color=look(r).colour, marker=look(r).marker, ls="") for r in shown]
    remark = "last epoch; bars: 95 % interval over images and seeds"
    legend_below(figure, (keys, [NAMES[r] for r in shown]), len(keys), remark)
    return figure


def _draw(panel: Axes, points: list[Data], field: str) -> None:
    """Draw the points of each readout with intervals, joined in the order of a field."""
    for readout in NAMES:
        own = [p for p in points if kind_of(p) == readout and p[field] and (field, readout) != ("rate_hz", "frame")]
        own.sort(key=lambda point: point[field])
        if not own:
            continue
        style = {"color": look(readout).colour, "marker": look(readout).marker, "linestyle": "-"}
        at = [point[field] for point in own]
        shown = [point | {"bootstrap_95": point["interval"]} for point in own]
        draw_accuracies(panel, at, shown, style, markersize=5, linewidth=1)
