"""Draw the accuracy of integer networks over the memory of their weights, and over additions per second."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.base.figures.style import GREY, PALETTE, dress, new_figure, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = tuple(PALETTE[name] for name in ("blue", "vermilion", "green", "orange", "purple", "sky", "black"))
MARKERS = "osD^vPX"
LEAST = 50.0
"""Per cent of accuracy where the panels begin: two bits are often below."""


def plot_precision(points: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw every network as a line over the bits of its weights, with the bits beside its points.

    Networks whose names differ only behind the first number, that of their neurons, share a column of panels.
    """
    families: dict[str, list[str]] = {}
    for point in points:
        own = families.setdefault(re.split(r"-\d", point["network"])[0], [])
        if point["network"] not in own:
            own.append(point["network"])
    figure = new_figure(
        max(4 * len(families), 7), 7, "Networks of whole numbers: accuracy, with the bits of their weights"
    )
    axes = figure.subplots(2, len(families), sharey=True, sharex="row", squeeze=False)
    for column, (family, networks) in enumerate(families.items()):
        for number, network in enumerate(networks):
            own_points = [p for p in points if p["network"] == network and p["variant"].isdigit()]
            _line(axes[0, column], own_points, "memory_bits", 1 / 8000, number, network)
            _line(axes[1, column], own_points, "operations_hz", 1e-6, number, network)
        dress(axes[0, column], family)
        axes[1, column].legend(fontsize=6, frameon=False, loc="lower right")
        for axis, text in zip(axes[:, column], ("memory, kB", "additions a second, millions"), strict=True):
            axis.set_xscale("log")
            axis.set_xlabel(text, fontsize=8)
            axis.set_ylim(LEAST, 100)
            axis.tick_params(labelsize=8)
            axis.axhline(90, color=GREY, linestyle=":", linewidth=0.8)
    for axis in axes[:, 0]:
        axis.set_ylabel("accuracy, %", fontsize=8)
    save_figure(figure, path)


def _line(axis: Axes, points: Sequence[dict[str, Any]], key: str, unit: float, number: int, network: str) -> None:
    x = [point[key] * unit for point in points]
    accuracy = [100 * point["accuracy"] for point in points]
    ends = [[100 * abs(p["accuracy"] - p["bootstrap_95"][end]) for p in points] for end in (0, 1)]
    colour, marker = COLOURS[number % len(COLOURS)], MARKERS[number % len(MARKERS)]
    axis.errorbar(x, accuracy, ends, color=colour, alpha=0.2, linestyle="none", capsize=2)
    axis.plot(x, accuracy, color=colour, marker=marker, markersize=3.5, linewidth=1, label=network)
    for point, at, y in zip(points, x, accuracy, strict=True):
        if y >= LEAST:
            axis.annotate(point["variant"], (at, y), (3, 3), textcoords="offset points", fontsize=6, color=colour)
