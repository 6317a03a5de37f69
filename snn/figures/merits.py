"""Draw latency, rest, timing and noise of events and frames, one panel each."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.base.figures.style import GREY, new_figure, save_figure
from eskin.skin.figures.readouts import look
from eskin.snn.figures.networks import COLOURS, MARKERS, network_styles

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_merits(result: dict[str, Any], path: Path) -> None:
    """Draw the data of ``eskin merits``."""
    figure = new_figure(11, 8, "What events and frames are good for")
    axes = figure.subplots(2, 2).ravel()
    _curves(axes[0], result["latency"], "time_s", "accuracy over the time since the touch, ms")
    _rest(axes[1], result["rest"])
    _timing(axes[2], result["timing"])
    of_paper = [point for point in result["noise"] if point["mode"] == "paper"]
    _curves(axes[3], of_paper, "noise_v", "accuracy over AFE noise, white to 10 kHz, mV")
    for axis in axes:
        axis.tick_params(labelsize=8)
        if axis.get_legend_handles_labels()[0]:
            axis.legend(fontsize=7, frameon=False)
    save_figure(figure, path)


def _curves(axis: Axes, points: list[dict[str, Any]], key: str, title: str) -> None:
    axis.set_title(title, fontsize=9, loc="left")
    for network, style in network_styles(points).items():
        own = [point for point in points if point["network"] == network]
        x, y = [1e3 * point[key] for point in own], [100 * point["accuracy"] for point in own]
        low, high = ([100 * point["bootstrap_95"][end] for point in own] for end in (0, 1))
        axis.fill_between(x, low, high, color=style["color"], alpha=0.1, linewidth=0)
        axis.plot(x, y, **style, markersize=4, label=network)
    axis.set_xscale("log")
    axis.set_ylim(0, 103)
    axis.set_ylabel("%", fontsize=8)


def _rest(axis: Axes, rows: list[dict[str, Any]]) -> None:
    axis.set_title("kb/s while the touch moves (full) and rests (open), as sent; + coded", fontsize=9, loc="left")
    noises = list(dict.fromkeys(row["noise_v"] for row in rows))
    for number, readout in enumerate(dict.fromkeys(row["readout"] for row in rows)):
        _, colour, marker = look(readout.partition(":")[0])
        for phase in ("moving", "resting"):
            own = [row for row in rows if (row["readout"], row["phase"]) == (readout, phase)]
            at = [noises.index(row["noise_v"]) + 0.08 * number for row in own]
            fill = colour if phase == "moving" else "none"
            label = readout if phase == "moving" else None
            sent = [max(1e-3 * row["sent_bps"], 0.01) for row in own]
            axis.plot(at, sent, color=colour, marker=marker, markerfacecolor=fill, linestyle="none", label=label)
            coded = [max(1e-3 * row["coded_bps"], 0.01) for row in own]
            axis.plot(at, coded, color=colour, marker="+", linestyle="none", markersize=4)
    axis.set_yscale("log")
    axis.set_xticks(range(len(noises)), [f"{1e3 * noise:g} mV" for noise in noises])
    axis.text(0.01, 0.02, "0.01 kb/s stands for less", transform=axis.transAxes, fontsize=6.5, color=GREY)


def _timing(axis: Axes, rows: list[dict[str, Any]]) -> None:
    axis.set_title("error of a crossing's time (median and 95 %), us, over kb/s sent", fontsize=9, loc="left")
    for number, name in enumerate(dict.fromkeys(row["known_from"] for row in rows)):
        own = [row for row in rows if row["known_from"] == name]
        x, y = [1e-3 * row["sent_bps"] for row in own], [1e6 * row["median_s"] for row in own]
        up = [1e6 * (row["p95_s"] - row["median_s"]) for row in own]
        style: dict[str, Any] = {"color": COLOURS[number], "marker": MARKERS[number], "markersize": 4, "capsize": 2}
        axis.errorbar(x, y, [[0.0] * len(up), up], label=name, **style)
    axis.set_xscale("log")
    axis.set_yscale("log")
