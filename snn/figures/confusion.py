"""Plot confusion matrices of sweep points."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.base.figures.style import new_figure, save_figure
from eskin.snn.experiments.points import READINGS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLE_LETTERS = 46
"""Most letters of a line above a matrix; a longer line would leave the picture."""


def plot_confusion(data: dict[str, Any], path: Path) -> None:
    """Plot confusion matrices to a file; see :func:`draw_confusion`."""
    save_figure(draw_confusion(data), path)


def draw_confusion(data: dict[str, Any]) -> Figure:
    """Return a figure with a confusion matrix per point, in percent of each true class."""
    points = data["points"]
    figure = new_figure(4.3 * len(points) + 0.4, 4.3, f"Confusion, {READINGS[data['reading']]}")
    panels = figure.subplots(1, len(points), squeeze=False)[0]
    for panel, point in zip(panels, points, strict=True):
        names = point["class_names"]
        shares = [[100 * n / sum(row) if sum(row) else 0.0 for n in row] for row in point["confusion"]]
        panel.imshow(shares, cmap="Blues", vmin=0, vmax=100)
        for i, row in enumerate(shares):
            for j, share in enumerate(row):
                colour = "white" if share > 55 else "black" if share else "#aaaaaa"
                panel.text(j, i, f"{share:.1f}", ha="center", va="center", fontsize=7.5, color=colour)
        panel.set_xticks(range(len(names)), names, rotation=35, ha="right", rotation_mode="anchor", fontsize=8)
        panel.set_yticks(range(len(names)), names, fontsize=8)
        panel.spines[:].set_visible(False)
        panel.tick_params(length=0)
        panel.set_xlabel("predicted (% of the true class)", fontsize=8.5)
        panel.set_ylabel("true", fontsize=8.5)
        title = textwrap.fill(f"{point['label']}: {100 * point['accuracy']:.1f} %", TITLE_LETTERS)
        panel.set_title(title, fontsize=8.5, loc="left")
    return figure
