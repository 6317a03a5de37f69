"""Accuracy of integer networks over the memory of their weights, and over the additions a second."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from model.figures.style import GREY, PALETTE, new_figure, save_figure

COLOURS = tuple(PALETTE[name] for name in ("blue", "vermilion", "green", "orange", "purple", "sky", "black"))
MARKERS = "osD^vPX"


def plot_precision(points: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw every network as a line over the bits of its weights, which stand beside its points."""
    figure = new_figure(11, 4.8, "Accuracy of networks of whole numbers; the bits of their weights stand beside them")
    left, right = figure.subplots(1, 2, sharey=True)
    for number, network in enumerate(dict.fromkeys(point["network"] for point in points)):
        own = [p for p in points if p["network"] == network and p["variant"].isdigit()]
        colour, marker = COLOURS[number % len(COLOURS)], MARKERS[number // len(COLOURS) % len(MARKERS)]
        accuracy = [100 * point["accuracy"] for point in own]
        ends = [[100 * abs(p["accuracy"] - p["bootstrap_95"][end]) for p in own] for end in (0, 1)]
        for axis, x in (
            (left, [point["memory_bits"] / 8000 for point in own]),
            (right, [point["operations_hz"] / 1e6 for point in own]),
        ):
            axis.errorbar(x, accuracy, ends, color=colour, alpha=0.25, linestyle="none", capsize=2)
            axis.plot(x, accuracy, color=colour, marker=marker, markersize=4, linewidth=1, label=network)
            for point, at, y in zip(own, x, accuracy, strict=True):
                axis.annotate(point["variant"], (at, y), (3, 3), textcoords="offset points", fontsize=6, color=colour)
    for axis, text in ((left, "memory, kB"), (right, "additions a second, millions")):
        axis.set_xscale("log")
        axis.set_xlabel(text, fontsize=8)
        axis.tick_params(labelsize=8)
        axis.axhline(90, color=GREY, linestyle=":", linewidth=0.8)
    left.set_ylabel("accuracy, %", fontsize=8)
    left.legend(fontsize=6, frameon=False, loc="lower right")
    save_figure(figure, path)
