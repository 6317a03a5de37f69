"""Plot the accuracy of trained networks under every disturbance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.base.figures.style import dress, legend_below, new_figure, save_figure
from eskin.snn.data.disturb import DISTURBANCES
from eskin.snn.figures.networks import accuracies, draw_networks, label, network_styles

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS = 3

Points = Sequence[dict[str, Any]]


def plot_robustness(data: Mapping[str, Any], path: Path) -> None:
    """Plot accuracy against disturbance strength, with intervals.

    Disturbances of one strength share the last panel, one row for each.
    """
    points = data["points"]
    strengths = {
        name: sorted({point["strength"] for point in points if point["disturbance"] == name}) for name in DISTURBANCES
    }
    curves = [name for name, found in strengths.items() if len(found) > 1]
    single = [name for name, found in strengths.items() if len(found) == 1]
    styles = network_styles(sorted(points, key=lambda point: str(point["network"])))
    rows = max(1, -(-len(curves) // COLUMNS))
    height = 2.3 * rows + (0.7 + 0.36 * len(single)) * bool(single)
    figure = new_figure(11, 1.2 + height, "Trained networks under disturbances")
    parts = figure.subfigures(2, 1, squeeze=False, height_ratios=[2.3 * rows, max(height - 2.3 * rows, 0.01)])
    upper, lower = parts[:, 0]
    panels = upper.subplots(rows, COLUMNS, sharey=True, squeeze=False)
    for number, panel in enumerate(panels.ravel()):
        if number < len(curves):
            _draw_curve(panel, curves[number], strengths[curves[number]], points, styles)
        else:
            panel.set_visible(False)
    for panel in panels[:, 0]:
        panel.set_ylabel("accuracy (%)", fontsize=8.5)
    shown = panels[0, 0]
    if single:
        last = lower.subplots()
        _draw_rows(last, single, points, styles)
        shown = shown if curves else last
    words = "bars: 95 % interval over images and seeds; dotted: undisturbed scans"
    legend_below(figure, shown.get_legend_handles_labels(), 4, words, handlelength=3)
    save_figure(figure, path)


def _described(name: str) -> str:
    """Return the axis label of a disturbance: meaning and unit of its strength."""
    unit = DISTURBANCES[name].unit
    return DISTURBANCES[name].help + f" ({unit})" * bool(unit)


def _draw_curve(
    panel: Axes, name: str, strengths: Sequence[float], points: Points, styles: Mapping[str, dict[str, Any]]
) -> None:
    """Draw accuracy against the strength of one disturbance."""
    dress(panel)
    own = sorted(
        (point for point in points if point["disturbance"] == name), key=lambda point: float(point["strength"])
    )
    draw_networks(panel, own, lambda point: strengths.index(point["strength"]), styles)
    for point in points:
        if point["disturbance"] == "clean":
            colour = styles[point["network"]]["color"]
            panel.axhline(100 * point["accuracy"], color=colour, linestyle=":", linewidth=1)
    panel.set_xticks(range(len(strengths)), [f"{strength:g}" for strength in strengths])
    panel.set_xlabel(_described(name), fontsize=8)
    panel.set_ylim(0, 103)


def _draw_rows(panel: Axes, names: Sequence[str], points: Points, styles: Mapping[str, dict[str, Any]]) -> None:
    """Draw the accuracy under disturbances that have a single strength."""
    dress(panel, "disturbances at one strength", "accuracy (%)")
    for number, (network, style) in enumerate(styles.items()):
        own = [point for point in points if point["network"] == network and point["disturbance"] in names]
        middle, ends = accuracies(own)
        move = 0.3 * (number / max(len(styles) - 1, 1) - 0.5)
        at = [names.index(point["disturbance"]) + move for point in own]
        panel.errorbar(middle, at, xerr=ends, **style | {"linestyle": "none"}, markersize=4, capsize=2,
                       label=label(network))  # fmt: skip
    rows = {point["disturbance"]: point["strength"] for point in points}
    units = {name: DISTURBANCES[name].unit for name in names}
    ticks = [f"{DISTURBANCES[name].help}: {rows[name]:g} {units[name]}".rstrip() for name in names]
    panel.set_yticks(range(len(names)), ticks)
    panel.set_ylim(len(names) - 0.5, -0.5)
    panel.set_xlim(0, 103)
