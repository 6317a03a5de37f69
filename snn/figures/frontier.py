"""Draw the frontier: accuracy against data rate and power, one column of panels per scan and network."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.base.figures.labels import Box, Taken, on_page, place_label
from eskin.base.figures.style import GREY, dress, new_figure, save_figure
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

AXES = {"bits_per_s": "bits/s", "power_w": "power (W), seven corrections, 1 mV of noise"}
"""Fields of a point on the axes of both rows, with their labels."""

LEGEND = "bars: 95 % interval over images and seeds; thin line to the left: the rate after lossless coding"


def kind_of(point: Data) -> str:
    """Return the encoder of a point, or ``frame``."""
    name = str(point["readout"]).partition(":")[0]
    return "frame" if name.startswith("frame") else name


def words_of(point: Data) -> str:
    """Return bits, or rate and bits of frames, and the number of taxels of a point."""
    kind, *numbers = str(point["readout"]).split(":")
    words = f"{numbers[0]} b"
    if kind.startswith("frame"):
        levels = f", levels of {numbers[2]} b" if len(numbers) > 2 else ""
        words = f"{RECEIVED.get(kind.removeprefix('frame-'), '')}{numbers[0]} Hz {numbers[1]} b{levels}"
    return f"{words}, {len(point['taxels'])} taxels"


def plot_frontier(data: Data, path: Path) -> None:
    """Draw accuracy against data rate and power; see :func:`draw_frontier`."""
    save_figure(draw_frontier(data), path)


def draw_frontier(data: Data) -> Figure:
    """Return accuracy against data rate and power, one column for each scan and network."""
    from matplotlib.lines import Line2D

    columns = list(dict.fromkeys((point["preset"], point["network"]) for point in data["points"]))
    figure = new_figure(2.0 + 4.2 * len(columns), 8.6, "Accuracy, data rate and power of chosen taxels")
    panels = figure.subplots(len(AXES), len(columns), sharey=True, squeeze=False)
    for row, label in zip(panels, AXES.values(), strict=True):
        row[0].set_ylabel("accuracy (%)", fontsize=8.5)
        for panel, (preset, network) in zip(row, columns, strict=True):
            dress(panel, f"{preset} scan, {NETWORKS[network]}")
            panel.set_xscale("log")
            panel.set_xlabel(label, fontsize=8.5)
    panels[0][0].set_ylim(40, 102)
    there = {kind_of(point) for point in data["points"]}
    keys = [
        Line2D([], [], color=look(r).colour, marker=look(r).marker, ls="", label=NAMES[r]) for r in NAMES if r in there
    ]
    legend = figure.legend(handles=keys, loc="outside lower left", ncols=len(keys), title=f"last epoch; {LEGEND}",
                           title_fontsize=8, fontsize=8, frameon=False, alignment="left")  # fmt: skip
    legend.get_title().set_color(GREY)
    shown = [
        (panel, axis, [p for p in data["points"] if (p["preset"], p["network"]) == column and p[axis]])
        for row, axis in zip(panels, AXES, strict=True)
        for panel, column in zip(row, columns, strict=True)
    ]
    for panel, axis, points in shown:
        for point in points:
            _draw_point(panel, point, axis)
        panel.margins(x=0.2)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for panel, axis, points in shown:
        _label_points(panel, points, axis)
    return figure


def _draw_point(panel: Axes, point: Data, axis: str) -> None:
    """Draw the mark of a point with its interval and its coded rate."""
    style: dict[str, Any] = {"color": look(kind_of(point)).colour, "lw": 1}
    at, middle = point[axis], 100 * point["accuracy"]
    panel.plot(at, middle, marker=look(kind_of(point)).marker, ms=7, ls="", color=style["color"])
    panel.plot([at, at], [100 * end for end in point["interval"]], marker="_", ms=5, alpha=0.75, zorder=1.5, **style)
    if axis == "bits_per_s":
        panel.plot([point["coded_bits_per_s"], at], [middle, middle], marker="|", ms=6, alpha=0.75, zorder=1.5, **style)


def _label_points(panel: Axes, points: list[Data], axis: str) -> None:
    """Write the words of every point beside its mark."""
    taken, boxes = Taken(), []
    for point in points:
        x, y = on_page(panel, point[axis], 100 * point["accuracy"])
        ends = [on_page(panel, point[axis], 100 * end)[1] for end in point["interval"]]
        box = Box(x - 3.5, min(ends[0], y - 3.5), x + 3.5, max(ends[1], y + 3.5))
        taken.boxes.append(box)
        boxes.append((point, box))
    for point, box in boxes:
        place, colour = (point[axis], 100 * point["accuracy"]), look(kind_of(point)).colour
        label = panel.annotate(words_of(point), place, xytext=(0, 0), textcoords="offset points", fontsize=7,
                               color=colour)  # fmt: skip
        place_label(panel, label, box, taken, "right above below left")
