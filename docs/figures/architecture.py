"""Draw docs/figures/signal_path.png and house.png: the way of a signal, and the rooms with their imports.

``python docs/figures/architecture.py`` from the top of the project. Names of signals are the ports of the RTL, arrows
between rooms are the imports. networkx comes with scikit-image.
"""

from __future__ import annotations

import ast
import textwrap
from collections.abc import Collection
from pathlib import Path
from typing import Any

import networkx as nx
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

from eskin.base.figures.style import PALETTE, new_figure, save_figure
from eskin.model.config import ReadoutConfig
from eskin.rtl.arbiter import Arbiter
from eskin.rtl.link import FourPhaseLink
from eskin.rtl.taxel import Row, Taxel

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
NO_ROOMS = {"eskin", "tests", "docs", "benchmarks", "out", "build", "dist"}
ORANGE, GREEN = PALETTE["orange"], PALETTE["green"]


def plane(title: str, width: float, height: float, inches: float = 0.5) -> tuple[Any, Axes]:
    """Return a figure and its empty plane."""
    figure = new_figure(inches * width, inches * height, title)
    axis = figure.add_subplot(xlim=(0, width), ylim=(0, height))
    axis.axis("off")
    return figure, axis


def box(axis: Axes, x: float, y: float, width: float, height: float, text: str, colour: str = "blue") -> None:
    """Draw a box around a text."""
    edge = PALETTE[colour]
    style = "round,pad=0,rounding_size=0.1"
    axis.add_patch(FancyBboxPatch((x, y), width, height, style, fc=edge + "22", ec=edge, lw=1.2))
    axis.text(x + width / 2, y + height / 2, text, ha="center", va="center", fontsize=9)


def arrow(
    axis: Axes, start: tuple[float, float], end: tuple[float, float], names: Collection[str] = (), **style: Any
) -> None:
    """Draw an arrow below the names of its signals."""
    axis.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "shrinkA": 0, "shrinkB": 2} | style)
    label(axis, (start[0] + end[0]) / 2, start[1] + 0.1, "\n".join(sorted(names)))


def label(axis: Axes, x: float, y: float, text: str, **style: Any) -> None:
    """Write names of signals."""
    axis.text(x, y, text, **{"ha": "center", "va": "bottom", "fontsize": 8, "family": "monospace"} | style)


def ports(block: type, direction: str) -> set[str]:
    """Return the names of a block's inputs or outputs."""
    members = block(ReadoutConfig(rows=2, columns=2, link="four_phase")).signature.members
    return {name for name, member in members.items() if member.flow.name == direction}


def draw_signal_path() -> None:
    """Draw the way of a signal from the texture to the class."""
    figure, axis = plane("From signal to class", 25.5, 8.5)
    lines = ports(Arbiter, "In") - ports(FourPhaseLink, "Out")
    for row in range(3):
        y = 6.4 - 1.8 * row
        axis.plot([5.2, 11.5], [y - 0.45] * 2, color=ORANGE)
        arrow(axis, (11.5, y - 0.45), (12.7, y - 0.45), color=ORANGE)
        for column in range(4):
            x = 5.2 + 1.4 * column
            box(axis, x, y, 0.9, 0.9, f"{row},{column}")
            axis.plot([x + 0.25] * 2, [y, y - 0.45], color=ORANGE)
            axis.plot([x + 0.9, x + 1.05, x + 1.05], [y + 0.45, y + 0.45, 1.6], color=GREEN)
    axis.plot([6.25, 14.1, 14.1], [1.6, 1.6, 1.7], color=GREEN)
    arrow(axis, (14.1, 1.6), (14.1, 2.1), color=GREEN)
    label(axis, 11.8, 6.05, "\n".join(n for n in lines if n.startswith("row")), color=ORANGE, fontsize=7)
    label(axis, 10.0, 1.5, ", ".join(sorted(n for n in lines if n.startswith("column"))), color=GREEN, va="top")
    label(axis, 7.9, 7.5, "each taxel: " + ", ".join(sorted(ports(Taxel, "Out"))))
    label(axis, 14.1, 7.5, "back to the rows: " + ", ".join(sorted(ports(Arbiter, "Out") & ports(Row, "In"))))
    box(
        axis, 12.7, 2.1, 2.8, 5.2, "arbiter\n\na row is granted,\nits requests are\nlatched, one leaves\nin every clock"
    )
    box(axis, 0.2, 4.1, 2.6, 2, "textures or\nown samples", "grey")
    box(axis, 18.2, 4.1, 2.2, 2, "link\n\nstream or\nfour_phase")
    box(axis, 22.6, 4.1, 2.7, 2, "address events\n\nt, x, y, p", "purple")
    box(axis, 22.6, 0.9, 2.7, 1.3, "classifier", "vermilion")
    box(axis, 18.2, 0.9, 2.2, 1.3, "class", "grey")
    arrow(axis, (2.8, 5.1), (5.2, 5.1), ports(Taxel, "In") & ports(Row, "In") - {"enable", "tick", "granted"})
    arrow(axis, (15.5, 5.1), (18.2, 5.1), ports(Arbiter, "Out") & ports(FourPhaseLink, "In"))
    arrow(axis, (20.4, 5.1), (22.6, 5.1), ports(FourPhaseLink, "Out") - ports(Arbiter, "In"))
    arrow(axis, (23.95, 4.1), (23.95, 2.2))
    arrow(axis, (22.6, 1.55), (20.4, 1.55))
    save_figure(figure, HERE / "signal_path.png")


def house() -> nx.DiGraph:
    """Return the rooms, with an edge from each to every room that it imports."""
    rooms = {path.parent.name for path in ROOT.glob("*/__init__.py")} - NO_ROOMS
    graph = nx.DiGraph()
    graph.add_nodes_from(rooms)
    for room in rooms:
        for node in (node for path in (ROOT / room).rglob("*.py") for node in ast.walk(ast.parse(path.read_text()))):
            start = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
            names = [start + alias.name for alias in getattr(node, "names", [])]
            graph.add_edges_from(
                (room, other) for other in {part for name in names for part in name.split(".")[1:2]} & rooms - {room}
            )
    return graph


def draw_house() -> None:
    """Draw the rooms, with their folders, above those that they import; an arrow that others imply is left out."""
    graph = nx.transitive_reduction(house())  # raises if imports run in a circle
    floors = list(nx.topological_generations(graph.reverse()))
    width = 5.0 * max(map(len, floors))
    figure, axis = plane("Rooms and their imports", width, 2.5 * len(floors))
    places = {}
    for floor, rooms in enumerate(floors):
        for number, room in enumerate(sorted(rooms)):
            places[room] = x, y = width * (number + 0.5) / len(rooms), 2.5 * floor + 1
            folders = ", ".join(sorted(path.parent.name for path in (ROOT / room).glob("*/__init__.py")))
            box(axis, x - 2.3, y - 0.75, 4.6, 1.5, f"{room}/\n\n{textwrap.fill(folders, 32)}")
    for upper, lower in graph.edges:
        (x, y), (to_x, to_y) = places[upper], places[lower]
        arrow(axis, (x, y - 0.75), (to_x, to_y + 0.75), color="#555555")
    save_figure(figure, HERE / "house.png")


if __name__ == "__main__":
    draw_signal_path()
    draw_house()
