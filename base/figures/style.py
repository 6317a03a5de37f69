"""Common style and palette of all figures."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.base.errors import InputError
from eskin.base.files import atomic_write
from eskin.base.outputs import check_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Text

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
"""Colours of M. Okabe and K. Ito without yellow, and a grey; colour-blind people can distinguish them."""

GREY = "#555555"  # of remarks

PART_COLOURS = {"afe": PALETTE["sky"], "converter": PALETTE["orange"], "io": PALETTE["grey"]}
"""Colours of the parts of a power; no readout has such a colour."""
ON_COLOUR, OFF_COLOUR, UNMATCHED_COLOUR = PALETTE["blue"], PALETTE["orange"], PALETTE["black"]

FORMATS = (".png", ".pdf", ".svg")


def check_picture_path(path: str | Path) -> None:
    """Check the format and the folder of a picture path before any work."""
    path = Path(path)
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"pictures end in {', '.join(FORMATS)}, but {path.name} does not; rename the output")
    check_file(path)


def new_figure(width_in: float, height_in: float, title: str) -> Figure:
    """Return an empty figure with a title."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, x=0.01, ha="left", fontsize=11, fontweight="bold")
    return figure


def dress(panel: Axes, title: str = "", across: str = "", up: str = "") -> Text:
    """Apply the common style to a panel with labels of both axes: title on the left, thin grid lines, two spines.

    Returns the title.
    """
    for label, write in ((across, panel.set_xlabel), (up, panel.set_ylabel)):
        if label:
            write(label, fontsize=8.5)
    panel.spines[["top", "right"]].set_visible(False)
    panel.tick_params(labelsize=8, length=3)
    panel.grid(axis="y", color="#e5e5e5", lw=0.6)
    panel.set_axisbelow(True)
    return panel.set_title(title, loc="left", fontsize=9.5, fontweight="bold", pad=4)


def legend_below(
    figure: Figure, keys: tuple[Iterable[Any], Iterable[str]], columns: int, remark: str = "", **style: Any
) -> None:
    """Write a legend of handles and labels below all panels of a figure, with a grey remark above its entries."""
    legend = figure.legend(list(keys[0]), list(keys[1]), loc="outside lower left", ncols=columns, fontsize=8,
                           frameon=False, alignment="left", title=remark or None,
                           **{"title_fontsize": 8} | style)  # fmt: skip
    legend.get_title().set_color(GREY)


def plain_numbers(panel: Axes) -> None:
    """Write the tick labels of a logarithmic x axis as plain numbers, without powers of ten."""
    from matplotlib.ticker import LogFormatter

    panel.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    panel.xaxis.set_minor_formatter(LogFormatter(minor_thresholds=(1, 0.4)))
    panel.tick_params(axis="x", which="minor", labelsize=8)


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure to a file, reproducibly byte for byte."""
    import matplotlib

    path = Path(path)
    check_picture_path(path)
    undated: dict[str, Any] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}[path.suffix.lower()]
    with matplotlib.rc_context({"svg.hashsalt": "figure"}), atomic_write(path) as file:
        figure.savefig(file, format=path.suffix[1:].lower(), dpi=160, metadata=undated)
