"""Plot the accuracy of integer networks against weight memory and additions per second."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.base.figures.style import GREY, dress, legend_below, new_figure, plain_numbers, save_figure
from eskin.snn.figures.networks import MARKERS, draw_accuracies, family

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BITS = ("2", "4", "8")
"""Bits that are written beside their points."""
LEAST = 50.0
"""Lower end of the panels, in percent accuracy; networks of two bits are often below."""


def plot_precision(data: Mapping[str, Any], path: Path) -> None:
    """Plot accuracy against memory and additions, one line per network; labels give the weight bits.

    Networks whose names differ only from the number of their neurons on share a column of panels. The more neurons,
    the darker the line; lines of networks that were trained with few bits are dashed.
    """
    points = data["points"]
    families: dict[str, list[str]] = {}
    for point in points:
        own = families.setdefault(family(point["network"])[0], [])
        if point["network"] not in own:
            own.append(point["network"])
    labels = sorted(
        {family(p["network"])[1] for p in points},
        key=lambda text: (int("0" + text.split()[0]) if text[0].isdigit() else 0, text),
    )
    styles = _styles(labels)
    figure = new_figure(max(3.6 * len(families), 7), 7, "Accuracy of integer networks by the bits of their weights")
    axes = figure.subplots(2, len(families), sharey=True, sharex="row", squeeze=False)
    for column, (title, networks) in enumerate(families.items()):
        dress(axes[0, column], title, "memory of the network (kB)")
        dress(axes[1, column], "", "additions (millions per second)")
        for network in networks:
            own_points = [p for p in points if p["network"] == network and p["variant"].isdigit()]
            label = family(network)[1]
            for axis, key, unit in (
                (axes[0, column], "memory_bits", 1 / 8000),
                (axes[1, column], "operations_hz", 1e-6),
            ):
                x = [point[key] * unit for point in own_points]
                draw_accuracies(axis, x, own_points, styles[label], markersize=4, linewidth=1, label=label)
            _bits(axes[0, column], own_points, styles[label]["color"])
        for axis in axes[:, column]:
            axis.set_xscale("log")
            plain_numbers(axis)
            axis.set_ylim(LEAST, 100)
            axis.axhline(90, color=GREY, linestyle=":", linewidth=0.8)
    for axis in axes[:, 0]:
        axis.set_ylabel("accuracy (%)", fontsize=8.5)
    known: dict[str, Any] = {}
    for axis in axes[0]:
        known |= dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))
    shown = [label for label in labels if label in known]
    words = f"numbers: weights of {', '.join(BITS)} bits, others between them; bars: 95 % interval; dotted: 90 %"
    legend_below(figure, ([known[label] for label in shown], shown), 3, words)
    save_figure(figure, path)


def _styles(labels: Sequence[str]) -> dict[str, dict[str, Any]]:
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    sizes = list(dict.fromkeys(label.partition(",")[0] for label in labels))
    found = {}
    for label in labels:
        number = sizes.index(label.partition(",")[0])
        colour = to_hex(colormaps["Blues"](0.45 + 0.5 * number / max(len(sizes) - 1, 1)))
        few = "," in label
        found[label] = {
            "color": colour,
            "marker": MARKERS[number % len(MARKERS)],
            "linestyle": "--" if few else "-",
            "markerfacecolor": "white" if few else colour,
        }
    return found


def _bits(axis: Axes, points: Sequence[dict[str, Any]], colour: str) -> None:
    for point in points:
        if (y := 100 * point["accuracy"]) >= LEAST and point["variant"] in BITS:
            at = point["memory_bits"] / 8000, y
            axis.annotate(point["variant"], at, (3, 3), textcoords="offset points", fontsize=6, color=colour)
