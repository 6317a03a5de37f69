"""Plot the accuracy of trained networks under every disturbance."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.base.figures.style import dress, legend_below, new_figure, save_figure
from eskin.snn.data.disturb import DISTURBANCES
from eskin.snn.figures.networks import draw_networks, network_styles

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS = 4
LETTERS = 34
"""Most letters of a line below a panel; a longer line would meet the next panel's."""


def plot_robustness(data: Mapping[str, Any], path: Path) -> None:
    """Plot accuracy against disturbance strength, with intervals; one panel for each disturbance."""
    points = data["points"]
    names = [name for name in DISTURBANCES if any(point["disturbance"] == name for point in points)]
    styles = network_styles(sorted(points, key=lambda point: str(point["network"])))
    rows = max(1, -(-len(names) // COLUMNS))
    figure = new_figure(11, 1.2 + 2.3 * rows, "Trained networks under disturbances")
    panels = figure.subplots(rows, COLUMNS, sharey=True, squeeze=False)
    for panel in panels.ravel()[len(names) :]:
        panel.set_visible(False)
    for panel, name in zip(panels.ravel(), names, strict=False):
        own = [point for point in points if point["disturbance"] == name]
        _draw(panel, name, sorted(own, key=lambda point: float(point["strength"])), styles)
        for point in points:
            if point["disturbance"] == "clean":
                colour = styles[point["network"]]["color"]
                panel.axhline(100 * point["accuracy"], color=colour, linestyle=":", linewidth=1)
    for panel in panels[:, 0]:
        panel.set_ylabel("accuracy (%)", fontsize=8.5)
    words = "bars: 95 % interval over images and seeds; dotted: undisturbed scans"
    legend_below(figure, panels[0, 0].get_legend_handles_labels(), 4, words, handlelength=3)
    save_figure(figure, path)


def _draw(panel: Axes, name: str, points: Sequence[Mapping[str, Any]], styles: Mapping[str, Mapping[str, Any]]) -> None:
    dress(panel)
    strengths = list(dict.fromkeys(point["strength"] for point in points))
    draw_networks(panel, points, lambda point: strengths.index(point["strength"]), styles)
    unit = DISTURBANCES[name].unit
    panel.set_xticks(range(len(strengths)), [f"{strength:g}" for strength in strengths])
    panel.set_xlim(-0.3, len(strengths) - 0.7)
    panel.set_xlabel(textwrap.fill(DISTURBANCES[name].help + f" ({unit})" * bool(unit), LETTERS), fontsize=8)
    panel.set_ylim(0, 103)
