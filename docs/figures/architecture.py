"""Draw docs/figures/signal_path.png and house.png: the signal path, and the packages with their imports.

``python docs/figures/architecture.py`` from the top of the project. Names of signals are the ports of the RTL, arrows
between rooms are the imports. networkx comes with scikit-image.
"""

import itertools
import re
import textwrap
from collections.abc import Collection
from pathlib import Path
from typing import Any, get_args

import networkx as nx
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

from eskin.base.figures.style import PALETTE, new_figure, save_figure
from eskin.model.config import Link, ReadoutConfig
from eskin.rtl.arbiter import Arbiter
from eskin.rtl.links.four_phase import FourPhaseLink
from eskin.rtl.taxel import Row, Taxel

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
NO_ROOMS = {"eskin", "tests", "docs", "benchmarks", "studies", "out", "build", "dist"}
ORANGE, GREEN = PALETTE["orange"], PALETTE["green"]


def plane(title: str, width: float, height: float) -> tuple[Any, Axes]:
    """Return a figure with empty axes."""
    figure = new_figure(0.5 * width, 0.5 * height, title)
    axis = figure.add_subplot(xlim=(0, width), ylim=(0, height))
    axis.axis("off")
    return figure, axis


def box(axis: Axes, x: float, y: float, width: float, height: float, text: str, colour: str = "blue") -> None:
    """Draw a text in a box."""
    edge = PALETTE[colour]
    style = "round,pad=0,rounding_size=0.1"
    axis.add_patch(FancyBboxPatch((x, y), width, height, style, fc=edge + "22", ec=edge, lw=1.2))
    axis.text(x + width / 2, y + height / 2, text, ha="center", va="center", fontsize=9)


def arrow(
    axis: Axes, start: tuple[float, float], end: tuple[float, float], names: Collection[str] = (), **style: Any
) -> None:
    """Draw an arrow with the names of its signals."""
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
    """Draw the signal path from texture to class."""
    figure, axis = plane("From signal to class", 16, 12.5)
    lines = ports(Arbiter, "In") - ports(FourPhaseLink, "Out")
    for row in range(3):
        y = 10.2 - 1.8 * row
        axis.plot([4.6, 9.4], [y - 0.45] * 2, color=ORANGE)
        arrow(axis, (9.4, y - 0.45), (12.4, y - 0.45), color=ORANGE)
        for column in range(3):
            x = 4.6 + 1.6 * column
            box(axis, x, y, 1.0, 0.9, f"{row},{column}")
            axis.plot([x + 0.25] * 2, [y, y - 0.45], color=ORANGE)
            axis.plot([x + 1.0, x + 1.2, x + 1.2], [y + 0.45, y + 0.45, 5.3], color=GREEN)
    axis.plot([5.8, 12.9, 12.9], [5.3, 5.3, 5.4], color=GREEN)
    arrow(axis, (12.9, 5.3), (12.9, 5.9), color=GREEN)
    label(axis, 10.8, 9.85, "\n".join(n for n in lines if n.startswith("row")), color=ORANGE)
    label(axis, 9.2, 5.15, ", ".join(sorted(n for n in lines if n.startswith("column"))), color=GREEN, va="top")
    label(axis, 6.8, 11.35, "each taxel: " + ", ".join(sorted(ports(Taxel, "Out"))))
    label(axis, 13.5, 11.75, "back to the rows: " + ", ".join(sorted(ports(Arbiter, "Out") & ports(Row, "In"))))
    box(
        axis, 12.4, 5.9, 3.4, 5.7, "arbiter\n\na row is granted,\nits requests are\nlatched, one leaves\nin every clock"
    )
    box(axis, 0.1, 7.4, 2.5, 1.8, "textures or\nown samples", "grey")
    arrow(axis, (2.6, 8.3), (4.5, 8.3), ports(Taxel, "In") & ports(Row, "In") - {"enable", "tick", "granted"})
    arrow(axis, (15.1, 5.9), (15.1, 2.7))
    label(axis, 14.9, 3.0, "\n".join(sorted(ports(Arbiter, "Out") & ports(FourPhaseLink, "In"))), ha="right")
    box(axis, 12.9, 0.5, 2.9, 2.2, "link:\n" + " or\n".join(get_args(Link)))
    box(axis, 8.1, 0.5, 2.9, 2.2, "address events\n\nt, x, y, p", "purple")
    box(axis, 3.9, 0.9, 2.6, 1.4, "classifier", "vermilion")
    box(axis, 0.1, 0.9, 2.2, 1.4, "class", "grey")
    arrow(axis, (12.9, 1.6), (11.0, 1.6), ports(FourPhaseLink, "Out") - ports(Arbiter, "In"))
    arrow(axis, (8.1, 1.6), (6.5, 1.6))
    arrow(axis, (3.9, 1.6), (2.3, 1.6))
    save_figure(figure, HERE / "signal_path.png")


def house() -> nx.DiGraph:
    """Return the graph of imports between packages."""
    rooms = {path.parent.name for path in ROOT.glob("*/__init__.py")} - NO_ROOMS
    graph = nx.DiGraph()
    graph.add_nodes_from(sorted(rooms))
    for room in sorted(rooms):
        texts = (path.read_text() for path in (ROOT / room).rglob("*.py"))
        found = {name for text in texts for name in re.findall(r"^\s*(?:from|import) eskin\.(\w+)", text, re.MULTILINE)}
        graph.add_edges_from((room, other) for other in sorted(found & rooms - {room}))
    return graph


def places_of(graph: nx.DiGraph) -> dict[str, tuple[float, float]]:
    """Return column and row of every package, so that few arrows cross a package and arrows are short."""
    floors = list(map(sorted, nx.topological_generations(graph.reverse())))
    columns = max(map(len, floors))
    best: tuple[tuple[float, float], dict[str, tuple[float, float]]] = ((np.inf, np.inf), {})
    for chosen in itertools.product(*(itertools.permutations(range(columns), len(rooms)) for rooms in floors)):
        places = {
            room: (float(column), float(floor))
            for floor, (rooms, slots) in enumerate(zip(floors, chosen, strict=True))
            for room, column in zip(rooms, slots, strict=True)
        }
        over, length = 0, 0.0
        for upper, lower in sorted(graph.edges):
            (x, y), (to_x, to_y) = places[upper], places[lower]
            length += abs(x - to_x)
            for other, floor in places.values():
                passes = (x + (to_x - x) * (y - end) / (y - to_y) for end in (floor - 0.3, floor + 0.3))
                over += to_y < floor < y and any(abs(at - other) < 0.5 for at in passes)
        best = min(best, ((over, length), places), key=lambda found: found[0])
    return best[1]


def draw_house() -> None:
    """Draw every package above the packages that it imports, without redundant arrows."""
    graph = nx.transitive_reduction(house())  # raises if imports run in a circle
    places = {room: (5.0 * column + 2.5, 2.5 * floor + 1) for room, (column, floor) in places_of(graph).items()}
    width, height = (max(ends) for ends in zip(*places.values(), strict=True))
    figure, axis = plane("Rooms and their imports", width + 2.5, height + 1)
    for room, (x, y) in places.items():
        folders = ", ".join(sorted(path.parent.name for path in (ROOT / room).glob("*/__init__.py")))
        box(axis, x - 2.3, y - 0.75, 4.6, 1.5, f"{room}/\n{textwrap.fill(folders, 32)}")
    for upper, lower in sorted(graph.edges):
        (x, y), (to_x, to_y) = places[upper], places[lower]
        arrow(axis, (x, y - 0.75), (to_x, to_y + 0.75), color="#555555")
    save_figure(figure, HERE / "house.png")


if __name__ == "__main__":
    draw_signal_path()
    draw_house()
