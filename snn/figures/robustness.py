"""Draw the accuracy of trained networks under every disturbance, one panel each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from eskin.base.figures.style import GREY, new_figure, save_figure
from eskin.snn.data.disturb import DISTURBANCES
from eskin.snn.figures.networks import COLOURS

COLUMNS = 4


def plot_robustness(points: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw accuracy over strength with its interval; a dotted line marks the clean scans."""
    names = [name for name in DISTURBANCES if any(point["disturbance"] == name for point in points)]
    networks = sorted({point["network"] for point in points})
    rows = max(1, -(-len(names) // COLUMNS))
    figure = new_figure(12, 0.8 + 2.4 * rows, "Trained networks under disturbances: accuracy in %")
    axes = figure.subplots(rows, COLUMNS, sharey=True, squeeze=False).ravel()
    for axis in axes[len(names) :]:
        axis.set_visible(False)
    for axis, name in zip(axes, names, strict=False):
        disturbance = DISTURBANCES[name]
        axis.set_title(f"{name}{f', {disturbance.unit}' if disturbance.unit else ''}", fontsize=9, loc="left")
        axis.text(0.02, 0.04, disturbance.help, transform=axis.transAxes, fontsize=6.5, color=GREY)
        for colour, network in zip(COLOURS * len(networks), networks, strict=False):
            own = sorted(
                (p for p in points if (p["network"], p["disturbance"]) == (network, name)), key=lambda p: p["strength"]
            )
            at = [f"{point['strength']:g}" for point in own]
            middle = [100 * point["accuracy"] for point in own]
            ends = [[100 * abs(p["accuracy"] - p["bootstrap_95"][end]) for p in own] for end in (0, 1)]
            axis.errorbar(at, middle, ends, color=colour, marker="o", markersize=3.5, capsize=2, label=network)
            for point in points:
                if (point["network"], point["disturbance"]) == (network, "clean"):
                    axis.axhline(100 * point["accuracy"], color=colour, linestyle=":", linewidth=1)
        axis.set_ylim(0, 103)
        axis.tick_params(labelsize=8)
    if names:
        axes[0].legend(fontsize=7, loc="center left", frameon=False)
    save_figure(figure, path)
