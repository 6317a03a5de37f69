"""Plot latency, data rate at rest, timing error, noise and power of events and frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.base.figures.labels import Box, Taken, on_page, place_label
from eskin.base.figures.style import GREY, PALETTE, dress, legend_below, new_figure, plain_numbers, save_figure
from eskin.skin.figures.readouts import FRAME, look
from eskin.snn.figures.networks import draw_networks, label, network_styles

if TYPE_CHECKING:
    from matplotlib.axes import Axes


INTERPOLATED = PALETTE["sky"], "D"
"""Colour and marker of crossings that are interpolated between frames."""


def plot_merits(result: dict[str, Any], path: Path) -> None:
    """Plot the results of ``eskin merits``."""
    figure = new_figure(11, 9, "What events and frames are good for")
    axes = figure.subplots(2, 2).ravel()
    _curves(axes[0], result["latency"], "time_s", "how soon after a touch", "time since the touch (ms)")
    _rest(axes[1], result["rest"])
    _timing(axes[2], result["timing"])
    of_paper = [point for point in result["noise"] if point["mode"] == "paper"]
    _curves(axes[3], of_paper, "noise_v", "how much noise", "AFE noise, white to 10 kHz (mV rms)")
    for axis in axes:
        if axis.get_legend_handles_labels()[0]:
            axis.legend(
                fontsize=7.5, frameon=False, ncols=3, handlelength=3, loc="upper left", bbox_to_anchor=(-0.02, -0.13)
            )
    save_figure(figure, path)


def _curves(axis: Axes, points: list[dict[str, Any]], key: str, title: str, across: str) -> None:
    dress(axis, title, across, "accuracy (%)")
    draw_networks(axis, points, lambda point: 1e3 * point[key], network_styles(points))
    axis.set_xscale("log")
    axis.set_ylim(0, 103)
    axis.xaxis.set_major_formatter(lambda x, _: f"{x:g}")


def _rest(axis: Axes, rows: list[dict[str, Any]]) -> None:
    dress(axis, "data rate of a touch that moves (full) and rests (open)", "AFE noise (mV rms)", "data rate (kb/s)")
    noises = list(dict.fromkeys(row["noise_v"] for row in rows))
    for number, readout in enumerate(dict.fromkeys(row["readout"] for row in rows)):
        _, colour, marker = look(readout.partition(":")[0])
        for phase in ("moving", "resting"):
            own = [row for row in rows if (row["readout"], row["phase"]) == (readout, phase)]
            at = [noises.index(row["noise_v"]) + 0.08 * number for row in own]
            fill = colour if phase == "moving" else "none"
            name = label(readout) if phase == "moving" else None
            sent = [max(1e-3 * row["sent_bps"], 0.01) for row in own]
            axis.plot(at, sent, color=colour, marker=marker, markerfacecolor=fill, linestyle="none", label=name)
            coded = [max(1e-3 * row["coded_bps"], 0.01) for row in own]
            axis.plot(at, coded, color=colour, marker="+", linestyle="none", markersize=4)
    axis.plot([], [], color=GREY, marker="+", linestyle="none", markersize=4, label="after lossless coding")
    axis.set_yscale("log")
    axis.yaxis.set_major_formatter(lambda y, _: f"{y:g}" if y > 0.011 else "0.01 or less")
    axis.set_xticks([0.12 + place for place in range(len(noises))], [f"{1e3 * noise:g}" for noise in noises])


def _timing(axis: Axes, rows: list[dict[str, Any]]) -> None:
    dress(axis, "how well the time of a crossing is known (median, bar to 95 %)", "data rate (kb/s)", "error (us)")
    looks = {"events": look("lcs")[1:], "frames": look(FRAME)[1:], "interpolated": INTERPOLATED}
    names = {"events": "LCS 3 b", "frames": "frames", "interpolated": "frames, interpolated"}
    for name in dict.fromkeys(row["known_from"] for row in rows):
        own = [row for row in rows if row["known_from"] == name]
        x, y = [1e-3 * row["sent_bps"] for row in own], [1e6 * row["median_s"] for row in own]
        up = [1e6 * (row["p95_s"] - row["median_s"]) for row in own]
        colour, marker = looks[name]
        axis.errorbar(x, y, [[0.0] * len(up), up], label=names[name], color=colour, marker=marker, markersize=4,
                      capsize=2)  # fmt: skip
    axis.set_xscale("log")
    axis.set_yscale("log")


TITLES = {
    "paper": "published equations, noise up to 10 kHz",
    "consistent": "all corrections, noise below 97 Hz",
}


def plot_noise_power(data: Mapping[str, Any], path: Path) -> None:
    """Plot accuracy against power, one panel per mode of the power model; labels give the noise."""
    points = data["points"]
    figure = new_figure(11, 5.0, "Accuracy over total power of the readout; numbers beside points: AFE noise (mV rms)")
    axes = figure.subplots(1, len(TITLES), sharey=True)
    words_of = (str(digit) for point in points for cell in point["answers"] for digit in cell["labels"])
    classes = {1 + max(map(int, filter(str.isdigit, words_of)), default=-1)} - {0}
    for axis, (mode, title) in zip(axes, TITLES.items(), strict=True):
        dress(axis, f"{mode} mode: {title}", "total power (uW)")
        own = [point for point in points if point["mode"] == mode]
        draw_networks(axis, own, lambda point: 1e6 * point["power_w"]["total"], network_styles(points))
        axis.set_xscale("log")
        plain_numbers(axis)
        axis.set_ylim(0, 104)
        for guess in {100 / count for count in classes}:
            axis.axhline(guess, color=GREY, linestyle=":", linewidth=0.8)
    axes[0].set_ylabel("accuracy (%)", fontsize=8.5)
    words = "bars: 95 % interval over images and seeds; dotted: guessing"
    legend_below(figure, axes[0].get_legend_handles_labels(), 6, words, handlelength=3)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axis, mode in zip(axes, TITLES, strict=True):
        _label_points(axis, [point for point in points if point["mode"] == mode])
    save_figure(figure, path)


def _label_points(axis: Axes, points: Sequence[Mapping[str, Any]]) -> None:
    """Write the noise beside each point, where it covers no other point or label."""
    styles = network_styles(points)
    where = [(1e6 * point["power_w"]["total"], 100 * point["accuracy"]) for point in points]
    pages = [on_page(axis, *at) for at in where]
    marks = [Box(x - 2.5, y - 2.5, x + 2.5, y + 2.5) for x, y in pages]
    taken = Taken(list(marks))
    for network in styles:
        taken.add_line([page for page, point in zip(pages, points, strict=True) if point["network"] == network])
    for point, at, mark in zip(points, where, marks, strict=True):
        colour = styles[point["network"]]["color"]
        note = axis.annotate(f"{1e3 * point['noise_v']:g}", at, (0, 0), textcoords="offset points", fontsize=6,
                             color=colour, arrowprops={"arrowstyle": "-", "lw": 0.5, "color": colour})  # fmt: skip
        place_label(axis, note, mark, taken, "right above left below")
