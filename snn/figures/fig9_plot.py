"""Plot Fig. 9 from its data (``eskin.snn.figures.fig9``)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from eskin.base.figures.labels import Box, Taken, in_data, on_page, place_label, side_by_side
from eskin.base.figures.style import GREY, dress, legend_below, new_figure, save_figure
from eskin.skin.figures.readouts import FRAME, look
from eskin.skin.textures.presets import PRESETS
from eskin.snn.experiments.points import partial
from eskin.snn.figures.fig9 import NAMES, PUBLISHED_NAME, Data, title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

STYLES = (("-", "full"), ("--", "left"), ("-.", "bottom"), (":", "right"))
"""Line and filling of the marks of each sweep, in turn."""

ABOVE = {"lcs": "above right left below", FRAME: "right left above below"}
"""Readouts whose labels stand at the highest of their points, and the sides that are tried in turn; LCS is on top."""

MARK_POINTS = 7.0
RING_POINTS = 15.0
CAP_POINTS = 5.0
BARS = (
    "bars: 95 % interval over images and seeds; of published points, standard deviation over folds; "
    "points of one rate stand side by side"
)


Series = tuple[str, str, list[Data]]
"""Sweep, readout, and their points by rising data rate."""


def plot_fig9(data: Data, path: Path) -> None:
    """Plot accuracy against data rate to a file; see :func:`draw_fig9`."""
    save_figure(draw_fig9(data), path)


def draw_fig9(data: Data) -> Figure:
    """Return a figure of accuracy against normalised data rate, one panel per preset.

    Published points are hollow, with their standard deviation over folds if known. Own points are filled, with the
    interval over images and seeds. Points of unfinished cross-validations have a ring.
    """
    presets = [preset for preset in (*PRESETS, None) if any(point["preset"] == preset for point in data["points"])]
    sweeps = list(data["commands"])
    figure = new_figure(1.6 + 4.6 * len(presets), 5.6, "Accuracy against data rate")
    panels = figure.subplots(1, len(presets), sharex=True, sharey=True, squeeze=False)[0]
    of_panels = [[point for point in data["points"] if point["preset"] == preset] for preset in presets]
    for panel, preset, points in zip(panels, presets, of_panels, strict=True):
        rate = f"data rate / ({data['reference_bps'] / 1e3:g} kb/s)"
        dress(panel, f"{preset} scan" if preset else "own recordings", rate)
        _draw_axes(panel, {point["classes"] for point in points})
    rates = [point["normalised_rate"] for point in data["points"]]
    panels[0].set_xlim(0.6 * min(rates), 5 * max(rates))
    panels[0].set_ylim(0, 112)
    panels[0].set_yticks(range(0, 101, 20))
    panels[0].set_ylabel("accuracy (%)", fontsize=8.5)
    keys = _keys(data, sweeps)
    labels = (str(key.get_label()) for key in keys)
    legend_below(figure, (keys, labels), 4, "\n".join([*data["protocol"], BARS]), columnspacing=1.4)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # fix the sizes of panels and the places of labels
    full_frames = {p["normalised_rate"] for p in data["points"] if p["readout"].startswith("frame")}
    for panel, points in zip(panels, of_panels, strict=True):
        taken = Taken()
        for text in panel.texts:
            box = text.get_window_extent()
            taken.boxes.append(Box(*(end * 72 / figure.dpi for end in (box.x0, box.y0, box.x1, box.y1))))
        drawn = [
            (series, _draw_series(panel, series, _style(series[0], sweeps), taken))
            for series in _series(points, [PUBLISHED_NAME, *sweeps])
        ]
        if full_frames and not any(readout == "frame" for (_, readout, _), _ in drawn):
            _draw_frame_rate(panel, max(full_frames), taken)
        _label_points(panel, drawn, taken)
    return figure


def _draw_axes(panel: Axes, classes: set[int]) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    for count in sorted(classes):
        panel.axhline(100 / count, color=GREY, lw=0.9, ls=(0, (1, 2)), zorder=0)
        panel.text(0.005, 100 / count + 0.8, "chance", fontsize=7.5, color=GREY,
                   transform=panel.get_yaxis_transform())  # fmt: skip
    panel.set_xscale("log")
    panel.xaxis.set_major_locator(LogLocator(subs=(1, 3)))
    panel.xaxis.set_minor_locator(LogLocator(subs="all"))
    panel.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    panel.xaxis.set_minor_formatter(NullFormatter())


def _series(points: list[Data], sweeps: list[str]) -> Iterator[Series]:
    for sweep in sweeps:
        for readout in NAMES:
            chosen = [p for p in points if p["sweep"] == sweep and p["readout"].split(",")[0] == readout]
            networks = dict.fromkeys(p["detail"] for p in chosen) if readout == "frame" else [""]
            for network in networks:
                found = [p for p in chosen if network in ("", p["detail"])]
                if found:
                    yield sweep, readout, sorted(found, key=lambda p: p["normalised_rate"])


def _style(sweep: str, sweeps: list[str]) -> Data:
    """Return line and fill style of a sweep; published points are hollow and thin."""
    if sweep == PUBLISHED_NAME:
        return {"ls": "-", "lw": 0.7, "fillstyle": "none", "ms": MARK_POINTS - 1, "zorder": 1.8}
    line, filling = STYLES[sweeps.index(sweep) % len(STYLES)]
    fill = {"fillstyle": filling, "markerfacecoloralt": "white"}
    return {"ls": line, "lw": 1.5, "ms": MARK_POINTS, "zorder": 2} | fill


def _draw_series(panel: Axes, series: Series, style: Data, taken: Taken) -> list[Box]:
    """Draw a data series with error bars; return the boxes that labels must avoid.

    A mark keeps its numbers and is moved on the page, so that the line through the moved marks has numbers of its own.
    """
    from matplotlib.transforms import ScaledTranslation

    _, readout, points = series
    colour, marker = look(readout).colour, look(readout).marker
    boxes, joints = [], []
    for point in points:
        covered = _boxes(panel, point)
        move = side_by_side(covered, taken.boxes)
        covered = [box.moved(move) for box in covered]
        taken.boxes += covered
        boxes.append(covered[-1])
        at, middle, ends = point["normalised_rate"], 100 * point["accuracy"], _ends(point)
        place = panel.transData + ScaledTranslation(move / 72, 0, panel.figure.dpi_scale_trans)
        x, y = on_page(panel, at, middle)
        joints.append((x + move, y))
        panel.plot(at, middle, color=colour, marker=marker, transform=place, **style)
        if ends[1] > ends[0]:
            panel.plot([at, at], [100 * end for end in ends], color=colour, lw=style["lw"], marker="_", ms=CAP_POINTS,
                       mew=style["lw"], alpha=0.75, zorder=1.5, transform=place)  # fmt: skip
        if partial(point):
            panel.plot(at, middle, "o", ms=RING_POINTS, mfc="none", mec=GREY, mew=1, transform=place)
    panel.plot(*zip(*(in_data(panel, *joint) for joint in joints), strict=True), color=colour, lw=style["lw"],
               ls=style["ls"], zorder=style["zorder"])  # fmt: skip
    taken.add_line(joints)
    return boxes


def _boxes(panel: Axes, point: Data) -> list[Box]:
    """Return the areas covered by the marker of a point and by its error bar."""
    half = (RING_POINTS if partial(point) else MARK_POINTS) / 2
    x, middle = on_page(panel, point["normalised_rate"], 100 * point["accuracy"])
    low, high = (on_page(panel, point["normalised_rate"], 100 * end)[1] for end in _ends(point))
    mark, bar = Box(x - half, middle - half, x + half, middle + half), CAP_POINTS / 2
    return [mark, Box(x - bar, min(low - 1, mark.bottom), x + bar, max(high + 1, mark.top))]


def _ends(point: Data) -> tuple[float, float]:
    """Return the ends of an error bar: the interval, or the standard deviation over folds."""
    if "interval" in point:
        low, high = point["interval"]
        return low, high
    deviation = point.get("sd_over_folds", 0.0)
    return point["accuracy"] - deviation, point["accuracy"] + deviation


def _draw_frame_rate(panel: Axes, rate: float, taken: Taken) -> None:
    """Mark the data rate of frames if no network was trained on frames."""
    panel.axvline(rate, color=look(FRAME).colour, lw=1, ls=(0, (4, 3)), zorder=1)
    text = panel.annotate("rate of frames; no network\nwas trained on them here", (rate, 50), xytext=(0, 0),
                          textcoords="offset points", fontsize=7.5, color=look(FRAME).colour)  # fmt: skip
    x, y = on_page(panel, rate, 50)
    taken.boxes.append(Box(x - 1, -1e9, x + 1, 1e9))
    place_label(panel, text, Box(x - 2, y - 2, x + 2, y + 2), taken, "left right")


def _label_points(panel: Axes, drawn: list[tuple[Series, list[Box]]], taken: Taken) -> None:
    """Label every resolution once, and each network on frames."""
    groups: dict[tuple[str, str], list[tuple[Data, Box]]] = {}
    for (sweep, readout, points), boxes in drawn:
        for point, box in zip(points, boxes, strict=True):
            own = f"\n{sweep}" if readout == "frame" else ""
            groups.setdefault((readout, point["detail"] + own), []).append((point, box))
    for (readout, text), group in groups.items():
        if readout in ABOVE:
            point, box = max(group, key=lambda pair: pair[1].top)
        else:
            point, box = min(group, key=lambda pair: pair[1].bottom)
        label = panel.annotate(text.split("\n")[0], (point["normalised_rate"], 100 * point["accuracy"]), xytext=(0, 0),
                               textcoords="offset points", fontsize=7.5, color=look(readout).colour)  # fmt: skip
        place_label(panel, label, box, taken, ABOVE.get(readout, "below right left above"))


def _keys(data: Data, sweeps: list[str]) -> list[Line2D]:
    """Return the legend: readouts by colour and marker, sweeps by line and fill."""
    from matplotlib.lines import Line2D

    there = {point["readout"].split(",")[0] for point in data["points"]}
    keys = [
        Line2D([], [], color=look(r).colour, marker=look(r).marker, ls="", label=NAMES[r]) for r in NAMES if r in there
    ]
    for sweep in (PUBLISHED_NAME, *sweeps):
        keys.append(Line2D([], [], color=GREY, marker="o", label=title(sweep), **_style(sweep, sweeps)))
    if any(partial(point) for point in data["points"]):
        keys.append(Line2D([], [], ls="", marker="o", ms=11, mfc="none", mec=GREY, label="not all cells finished"))
    return keys
