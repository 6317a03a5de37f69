"""Fig. 9: accuracy against data rate with the published points, and confusion matrices, from sweeps.

The sweeps are those of the project and ``out/sweep/sweep.json``, which ``eskin sweep`` writes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from eskin.base.figures.labels import Box, Taken, in_data, on_page, place_label, side_by_side
from eskin.base.figures.style import GREY, dress, legend_below, new_figure, save_figure
from eskin.base.files import read_json
from eskin.power.readouts import READOUTS
from eskin.skin.figures.readouts import FRAME, LOOKS, look
from eskin.skin.textures.presets import PRESETS
from eskin.snn.experiments.points import READINGS, Point, Sweep, load_sweep, measured, unfinished
from eskin.snn.figures.confusion import plot_confusion
from studies.study import DATA, Data, Result, run

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

PUBLISHED = DATA / "published_fig9.json"
"""The points of the paper's Fig. 9."""

KEPT = DATA / "sweeps"
"""Folder of the project's sweeps: renamed copies of ``sweep.json``."""

LATEST = Path("out/sweep/sweep.json")
"""Default output of ``eskin sweep``."""

NAMES = {readout: look(readout).title for readout in dict.fromkeys((*READOUTS, *LOOKS))}
"""Names of all readouts in the order of the legend: first the readouts of the paper."""

TITLES = {
    "paper-network": "the paper's network",
    "reference-frames": "networks on frames",
    "tuned": "leaky network, bins of 4 ms",
    "tuned-2ms": "leaky network, bins of 2 ms",
}
"""Titles of the project's sweeps in figures; a sweep of a user keeps its name."""

FRAME_NETWORKS = {"rnn": "ReLU units", "cnn": "convolutions", "gru": "gated units"}
"""Titles of networks on frames, by the recipe, with which a point's name begins."""

RECEIVED = {"diff": "differences ", "onoff": "ON/OFF "}
"""Frames after preprocessing in the receiver, by the second word of a point's name (``eskin.snn.data.frame_steps``)."""

RATES = "rates-"
"""Beginning of the names of the frontier's sweeps."""

PUBLISHED_NAME = "published"

READING = "last"
"""Epoch whose accuracy is shown: ``last``, or ``selected`` by inner validation."""

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


def load_sweeps() -> list[Sweep]:
    """Return the project's sweeps and the latest sweep."""
    return [load_sweep(path) for path in kept_sweeps() + [LATEST] * LATEST.is_file()]


def kept_sweeps() -> list[Path]:
    """Return the paths of the project's sweeps, without the sweeps of the frontier."""
    return [path for path in sorted(KEPT.glob("*.json")) if not path.name.startswith(RATES)]


def fig9_data(sweeps: Sequence[Sweep], reading: str) -> Data:
    """Return the published points and the points of sweeps.

    Points without results are left out, and named in ``left_out``.
    """
    published = read_json(PUBLISHED, "the published points")
    points = [
        point
        | {
            "readout": f"{point['readout']}, {PUBLISHED_NAME}",
            "label": _label(point["readout"], detail(point), PUBLISHED_NAME),
            "detail": detail(point),
            "sweep": PUBLISHED_NAME,
            "title": PUBLISHED_NAME,
            "preset": published["preset"],
            "classes": published["classes"],
            "data_rate_bps": point["normalised_rate"] * published["reference_bps"],
        }
        for point in published["points"]
    ]
    left_out = []
    for sweep in sweeps:
        for point in sweep.points:
            if measured(point):
                points.append(own_point(sweep, point, reading))
            else:
                left_out.append(f"{sweep.name}: {point['name']}")
    named: dict[str, list[str]] = {}
    for sweep in sweeps:
        named.setdefault(_protocol(sweep, reading), []).append(title(sweep.name))
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


def own_point(sweep: Sweep, point: Point, reading: str) -> Data:
    """Return a sweep point for figures, with its interval over images and seeds."""
    found, preset = point[reading], point["preset"]
    label = _label(point["readout"], detail(point), title(sweep.name))
    if preset not in (None, "paper") and preset not in sweep.name:
        label += f", {preset} scan"
    if unfinished(point):
        label += f", {point['cells']['done']} of {point['cells']['of']} cells"
    own = ("readout", "name", "preset", "resolution", "cells", "data_rate_bps", "normalised_rate")
    of_result = ("accuracy", "wilson_95", "sd_over_cells", "sd_over_folds", "sd_over_seeds", "images")
    return {
        **{name: point[name] for name in own},
        **{name: found[name] for name in of_result},
        "label": label,
        "detail": detail(point),
        "sweep": sweep.name,
        "title": title(sweep.name),
        "classes": len(found["confusion"]),
        "interval": found["bootstrap_95"],
    }


def title(sweep: str) -> str:
    return TITLES.get(sweep, sweep)


def detail(point: Data) -> str:
    """Return the label of a point: resolution, network, or rate and bits."""
    words = str(point.get("name", "")).removeprefix("frame").strip("-").split("-")
    if not point["readout"].startswith("frame") or words == [""]:
        return f"{point['resolution']} b"
    if words[0] in FRAME_NETWORKS:
        return FRAME_NETWORKS[words[0]]
    kind = RECEIVED.get(words[0])
    rate, bits, *levels = [*words[kind is not None :], "", ""][:3]
    if not bits:
        return " ".join(words)
    return f"{kind or ''}{rate} Hz {bits} b{f', levels of {levels[0]} b' if levels[0] else ''}"


def _label(readout: str, point_detail: str, sweep: str) -> str:
    return f"{NAMES[readout]}{',' if readout == 'frame' else ''} {point_detail}, {sweep}"


def _protocol(sweep: Sweep, reading: str) -> str:
    """Return a text with images, folds, seeds and epoch of the finished points."""
    found = []
    for point in sweep.points:
        if measured(point) and not unfinished(point):
            of, seeds = point["cells"]["of"], point["cells"]["whole_seeds"]
            found.append(f"{point[reading]['images']} images, {of // seeds} folds x {seeds} seeds")
    return f"{' or '.join(dict.fromkeys(found)) or 'no point is finished'}, {READINGS[reading]}"


def confusion_data(sweeps: Sequence[Sweep], reading: str) -> Data:
    """Return the confusion matrices of the best finished spiking points by preset."""
    candidates = [(sweep, point) for sweep in sweeps for point in sweep.points if measured(point)]
    finished = [(s, point) for s, point in candidates if not unfinished(point) and point["readout"] != "frame"]
    of_presets = ([one for one in finished if one[1]["preset"] == preset] for preset in (*PRESETS, None))
    chosen = [max(own, key=lambda one: one[1][reading]["accuracy"]) for own in of_presets if own]
    return {
        "reading": reading,
        "points": [
            own_point(sweep, point, reading)
            | {"class_names": point["class_names"], "confusion": point[reading]["confusion"]}
            for sweep, point in chosen
        ],
    }


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
        if unfinished(point):
            panel.plot(at, middle, "o", ms=RING_POINTS, mfc="none", mec=GREY, mew=1, transform=place)
    panel.plot(*zip(*(in_data(panel, *joint) for joint in joints), strict=True), color=colour, lw=style["lw"],
               ls=style["ls"], zorder=style["zorder"])  # fmt: skip
    taken.add_line(joints)
    return boxes


def _boxes(panel: Axes, point: Data) -> list[Box]:
    """Return the areas covered by the marker of a point and by its error bar."""
    half = (RING_POINTS if unfinished(point) else MARK_POINTS) / 2
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
    if any(unfinished(point) for point in data["points"]):
        keys.append(Line2D([], [], ls="", marker="o", ms=11, mfc="none", mec=GREY, label="not all cells finished"))
    return keys


RESULTS = (
    Result("fig9", lambda: fig9_data(load_sweeps(), READING), plot_fig9),
    Result("confusion", lambda: confusion_data(load_sweeps(), READING), plot_confusion),
)

if __name__ == "__main__":
    run("fig9", *RESULTS)
