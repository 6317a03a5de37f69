"""Draw the accuracy of trained networks over the power of their readout, for each noise."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from eskin.base.figures.style import GREY, new_figure, save_figure
from eskin.snn.figures.networks import network_styles

TITLES = {
    "paper": "published equations, noise up to 10 kHz",
    "consistent": "all corrections, noise below 97 Hz",
}


def plot_noise_power(points: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw a panel for each mode; labels along a line give the noise."""
    figure = new_figure(
        11, 4.6, "Accuracy over total power of the readout, both at the AFE noise that is written in mV"
    )
    axes = figure.subplots(1, len(TITLES), sharey=True)
    for axis, (mode, title) in zip(axes, TITLES.items(), strict=True):
        axis.set_title(f"{mode}: {title}", fontsize=9, loc="left")
        for network, style in network_styles(points).items():
            own = [point for point in points if (point["network"], point["mode"]) == (network, mode)]
            power = [point["power_w"]["total"] for point in own]
            accuracy = [100 * point["accuracy"] for point in own]
            ends = [[100 * abs(p["accuracy"] - p["bootstrap_95"][end]) for p in own] for end in (0, 1)]
            colour = style["color"]
            axis.errorbar(power, accuracy, ends, color=colour, alpha=0.25, linestyle="none", capsize=2)
            axis.plot(power, accuracy, **style, markersize=4.5, label=network)
            for point, x, y in zip(own, power, accuracy, strict=True):
                text = f"{1e3 * point['noise_v']:g}"
                axis.annotate(text, (x, y), (3, 4), textcoords="offset points", fontsize=6, color=colour)
        axis.set_xscale("log")
        axis.set_xlabel("total power, W", fontsize=8)
        axis.set_ylim(0, 104)
        axis.tick_params(labelsize=8)
        axis.axhline(100 / 6, color=GREY, linestyle=":", linewidth=0.8)
    axes[0].set_ylabel("accuracy, %", fontsize=8)
    axes[0].legend(fontsize=7, frameon=False, loc="lower left")
    save_figure(figure, path)
