"""Plot the accuracy of trained networks against readout power, for several noise levels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.base.figures.labels import Box, Taken, on_page, place_label
from eskin.base.figures.style import GREY, dress, legend_below, new_figure, plain_numbers, save_figure
from eskin.snn.figures.networks import draw_accuracies, label, network_styles

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
        for network, style in network_styles(points).items():
            own = [point for point in points if (point["network"], point["mode"]) == (network, mode)]
            power = [1e6 * point["power_w"]["total"] for point in own]
            draw_accuracies(axis, power, own, style, markersize=4.5, label=label(network))
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
