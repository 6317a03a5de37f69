"""The look of the figures: one style, and one colour and mark for each readout in all pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from model.figures.raster import DPI, check_picture_path
from model.files import atomic_write

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PALETTE = {
    "black": "#000000",
    "orange": "#e69f00",
    "sky": "#56b4e9",
    "green": "#009e73",
    "blue": "#0072b2",
    "vermilion": "#d55e00",
    "purple": "#cc79a7",
    "grey": "#999999",
}
"""The colours of all pictures: those of M. Okabe and K. Ito but yellow, and a grey; told apart by colour-blind eyes."""

READOUT_COLOURS = {"nlcs": PALETTE["vermilion"], "lcs": PALETTE["blue"], "frame": PALETTE["black"]}
READOUT_MARKERS = {"nlcs": "^", "lcs": "o", "frame": "s"}


def new_figure(width_in: float, height_in: float, title: str) -> Figure:
    """Return an empty figure with a title."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, x=0.01, ha="left", fontsize=11, fontweight="bold")
    return figure


def dress(panel: Axes, title: str = "") -> None:
    """Give a panel the look of all pictures: a title on the left, thin grid lines, two spines."""
    panel.spines[["top", "right"]].set_visible(False)
    panel.tick_params(labelsize=8, length=3)
    panel.grid(axis="y", color="#e5e5e5", lw=0.6)
    panel.set_axisbelow(True)
    panel.set_title(title, loc="left", fontsize=9.5, fontweight="bold", pad=4)


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure; the same data give the same bytes."""
    import matplotlib

    check_picture_path(path)
    undated: dict[str, Any] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}[path.suffix.lower()]
    with matplotlib.rc_context({"svg.hashsalt": "figure"}), atomic_write(path) as file:
        figure.savefig(file, format=path.suffix[1:].lower(), dpi=DPI, metadata=undated)
