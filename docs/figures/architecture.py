"""Draw docs/figures/signal_path.png and packages.png: the way of a signal, and the packages with their arrows.

``python docs/figures/architecture.py`` from the top of the project. Names of signals are the ports of the RTL, names of
files are looked up, arrows are the imports. What is drawn stands in docs/data/architecture.json too, by which
a test knows when the pictures are stale.
"""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from model.config import ReadoutConfig
from model.figures.style import PALETTE, new_figure, save_figure

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
DATA = ROOT / "docs" / "data" / "architecture.json"

FILES = {
    "signal": "model/textures/scan.py model/events/samples.py",
    "taxel": "model/taxel.py rtl/taxel.py rtl/window.py rtl/decay.py",
    "arbiter": "model/arbiter.py rtl/arbiter.py",
    "link": "model/link.py rtl/link.py",
    "events": "model/events/address.py model/events/recording.py",
    "classifier": "snn/data/bins.py snn/network.py snn/kernels/layer.py",
}
"""The blocks on the way of a signal, and the files in which each is."""


def ports(block: Any, direction: str) -> set[str]:
    """Return the names of a block's inputs or outputs."""
    return {name for name, member in block.signature.members.items() if member.flow.name == direction}


def signal_path() -> dict[str, Any]:
    """Return the files of every block, and the signals between the blocks as the RTL names them."""
    from rtl.arbiter import Arbiter
    from rtl.link import FourPhaseLink
    from rtl.taxel import Row, Taxel

    config = ReadoutConfig(rows=2, columns=2, link="four_phase")
    taxel, row, arbiter, link = (block(config) for block in (Taxel, Row, Arbiter, FourPhaseLink))
    signals = {
        "signal to taxel": ports(taxel, "In") & ports(row, "In") - {"enable", "tick", "granted"},
        "taxel to lines": ports(taxel, "Out"),
        "lines to arbiter": ports(arbiter, "In") - ports(link, "Out"),
        "arbiter to lines": ports(arbiter, "Out") & ports(row, "In"),
        "arbiter to link": ports(arbiter, "Out") & ports(link, "In"),
        "link to events": ports(link, "Out") - ports(arbiter, "In"),
    }
    return {
        "files": {name: [file for file in files.split() if (ROOT / file).is_file()] for name, files in FILES.items()},
        "signals": {between: sorted(names) for between, names in signals.items()},
    }


def packages() -> dict[str, Any]:
    """Return the layers of every package from the ground up, and what each package uses of the others."""
    spec = importlib.util.spec_from_file_location("layers", ROOT / "tests" / "test_layers.py")
    assert spec is not None
    assert spec.loader is not None
    house = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(house)
    uses: dict[str, dict[str, set[str]]] = {package: {} for package in house.LAYERS}
    for module, imported in house.imports().items():
        package = module.partition(".")[0]
        for other in imported:
            parts = other.split(".")
            if parts[0] != package and len(parts) > 1:
                uses[package].setdefault(parts[0], set()).add(parts[1])
    return {
        "layers": {package: list(layers) for package, layers in house.LAYERS.items()},
        "uses": {p: {other: sorted(rooms) for other, rooms in sorted(of.items())} for p, of in uses.items()},
    }


def box(axis: Axes, at: tuple[float, float], size: tuple[float, float], text: str, colour: str, **style: Any) -> None:
    """Draw a box with a text in its middle."""
    (x, y), (width, height), edge = at, size, PALETTE[colour]
    shape = "round,pad=0,rounding_size=0.1"
    axis.add_patch(FancyBboxPatch(at, width, height, shape, fc=edge + "22", ec=edge, lw=1.2))
    axis.text(x + width / 2, y + height / 2, text, ha="center", va="center", **{"fontsize": 9} | style)


def arrow(
    axis: Axes, start: tuple[float, float], end: tuple[float, float], colour: str = "#333333", **style: Any
) -> None:
    """Draw an arrow."""
    style = {"arrowstyle": "-|>", "mutation_scale": 11, "lw": 1.2, "color": colour} | style
    axis.add_patch(FancyArrowPatch(start, end, **style))


def label(axis: Axes, x: float, y: float, text: str, **style: Any) -> None:
    """Write the names of signals or files."""
    axis.text(x, y, text, **{"ha": "center", "va": "bottom", "fontsize": 8, "family": "monospace"} | style)


def draw_array(axis: Axes, signals: dict[str, list[str]]) -> None:
    """Draw three rows of four taxels with their lines, and the arbiter that they lead to."""
    orange, green = PALETTE["orange"], PALETTE["green"]
    for row in range(3):
        y = 4.6 - 1.8 * row
        axis.plot([5.2, 11.4], [y - 0.45] * 2, color=orange, lw=1.4, zorder=0)
        arrow(axis, (11.3, y - 0.45), (12.6, y - 0.45), orange)
        for column in range(4):
            x = 5.2 + 1.4 * column
            box(axis, (x, y), (0.9, 0.9), f"{row},{column}", "blue", fontsize=7.5)
            axis.plot([x + 0.25] * 2, [y, y - 0.45], color=orange, lw=1.2)
            axis.plot([x + 0.9, x + 1.05], [y + 0.45] * 2, color=green, lw=1.2)
    for column in range(4):
        axis.plot([6.25 + 1.4 * column] * 2, [5.5, -0.2], color=green, lw=1.4, zorder=0)
    axis.plot([6.25, 14.0], [-0.2] * 2, color=green, lw=1.4)
    arrow(axis, (14.0, -0.2), (14.0, 0.25), green)
    text = "arbiter\n\na row is granted,\nits requests are\nlatched, one leaves\nin every clock"
    box(axis, (12.6, 0.25), (2.8, 5.25), text, "blue", fontsize=8.5)
    columns, rows = ([n for n in signals["lines to arbiter"] if n.startswith(line)] for line in ("column", "row"))
    label(axis, 7.9, 5.7, "each taxel: " + ", ".join(signals["taxel to lines"]))
    label(axis, 10.1, -0.35, ", ".join(columns), color=green, va="top")
    label(axis, 11.75, 4.3, "\n".join(rows), color=PALETTE["vermilion"], fontsize=7.5)
    label(axis, 14.0, 5.7, "back to the rows: " + ", ".join(signals["arbiter to lines"]))


def draw_signal_path(data: dict[str, Any], path: Path) -> None:
    """Draw the way of a signal from the texture to the class."""
    figure = new_figure(12.5, 4.5, "From signal to class")
    axis = figure.add_subplot()
    axis.set(xlim=(-0.6, 25.2), ylim=(-2.4, 6.4))
    axis.axis("off")
    signals, files = data["signals"], data["files"]
    draw_array(axis, signals)
    box(axis, (0.2, 2.2), (2.6, 2), "textures or\nown samples", "grey")
    box(axis, (18.1, 2.2), (2.2, 2), "link\n\nstream or\nfour_phase", "blue", fontsize=8.5)
    box(axis, (22.3, 2.2), (2.6, 2), "address events\n\nt, x, y, p", "purple")
    box(axis, (22.3, -1.1), (2.6, 1.3), "classifier", "vermilion")
    for start, end, between in (
        (2.8, 5.1, "signal to taxel"),
        (15.4, 18.1, "arbiter to link"),
        (20.3, 22.3, "link to events"),
    ):
        arrow(axis, (start, 3.2), (end, 3.2))
        label(axis, (start + end) / 2, 3.3, "\n".join(signals[between]))
    arrow(axis, (23.6, 2.2), (23.6, 0.2))
    arrow(axis, (22.3, -0.45), (21.4, -0.45))
    axis.text(21.3, -0.45, "class", ha="right", va="center", fontsize=11, fontweight="bold")
    for name, x, y in (
        ("signal", 1.5, 2.1),
        ("taxel", 7.9, -0.95),
        ("arbiter", 14.0, -0.95),
        ("link", 19.2, 2.1),
        ("events", 21.5, 1.35),
        ("classifier", 23.6, -1.2),
    ):
        side = "right" if name == "events" else "center"
        x = 23.4 if name == "events" else x
        label(axis, x, y, "\n".join(files[name]), ha=side, va="top", color="#555555", fontsize=7.5)
    save_figure(figure, path)


COLOURS = {"model": "blue", "rtl": "green", "flow": "orange", "snn": "vermilion", "cocotb_tests": "purple"}
PLACES = {"rtl": (0.2, 0.0), "model": (8.2, 0.0), "snn": (16.2, 0.0), "cocotb_tests": (0.2, 8.6), "flow": (8.2, 13.9)}
WAYS = {
    ("rtl", "model"): ((5.7, 2.6), (8.1, 2.6)),
    ("snn", "model"): ((16.1, 4.6), (13.7, 4.6)),
    ("cocotb_tests", "model"): ((5.7, 9.4), (8.1, 8.4)),
    ("flow", "model"): ((10.9, 13.8), (10.9, 12.4)),
    ("flow", "rtl"): ((8.1, 15.6), (5.65, 6.3)),
    ("flow", "cocotb_tests"): ((8.1, 17.0), (3.6, 13.3)),
    ("cocotb_tests", "rtl"): ((2.9, 8.5), (2.9, 6.6)),
}


def draw_packages(data: dict[str, Any], path: Path) -> None:
    """Draw every package with its layers, ground at the bottom, and what it uses of the others."""
    top = max(y + 0.82 * len(data["layers"][package]) for package, (_, y) in PLACES.items()) + 0.5
    title = "Packages: a file imports from its own layer, from those below it, and along the arrows"
    figure = new_figure(11, 0.53 * top, title)
    axis = figure.add_subplot()
    axis.set(xlim=(0, 21.8), ylim=(-0.2, top))
    axis.axis("off")
    for package, (x, y) in PLACES.items():
        for number, rooms in enumerate(data["layers"][package]):
            names = [{"__main__": "the command", "test_": "tests"}.get(room, room) for room in rooms.split()]
            middle = (len(names) + 1) // 2 if len(names) > 4 else len(names)
            text = "\n".join("   ".join(part) for part in (names[:middle], names[middle:]) if part)
            box(axis, (x, y + 0.82 * number), (5.4, 0.7), text, COLOURS[package], fontsize=8 if "\n" not in text else 7)
        top = y + 0.82 * len(data["layers"][package])
        axis.text(x, top + 0.05, f"{package}/", fontsize=12, fontweight="bold", color=PALETTE[COLOURS[package]])
    for package, of in data["uses"].items():
        for other, rooms in of.items():
            start, end = WAYS[package, other]
            arrow(axis, start, end, lw=2.2, mutation_scale=16)
            x, y = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
            if start[0] == end[0]:
                axis.text(x + 0.2, y, ", ".join(rooms), ha="left", va="center", fontsize=7.5)
            elif other == "rtl":
                axis.text(x - 0.1, y + 1.6, "\n".join(rooms), ha="right", va="center", fontsize=7.5)
            else:
                axis.text(x + 0.15, y - 0.5, "\n".join(rooms), ha="center", va="top", fontsize=7.5)
    save_figure(figure, path)


def data() -> dict[str, Any]:
    """Return all that is drawn."""
    return {"signal_path": signal_path(), "packages": packages()}


if __name__ == "__main__":
    drawn = data()
    DATA.write_text(json.dumps(drawn, indent=1) + "\n")
    draw_signal_path(drawn["signal_path"], HERE / "signal_path.png")
    draw_packages(drawn["packages"], HERE / "packages.png")
