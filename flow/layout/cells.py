"""Standard cells for layouts, and their liberty file."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from eskin.flow import programs


class Gate(NamedTuple):
    """Pins of a cell, and its function as Liberty text."""

    inputs: tuple[str, ...]
    output: str
    text: str


INPUTS = ("i0", "i1", "i2", "i3")
GATES: dict[str, Gate] = {
    "inv": Gate(("i",), "nq", "!i"),
    "buf": Gate(("i",), "q", "i"),
    **{f"nand{n}": Gate(INPUTS[:n], "nq", f"!({'&'.join(INPUTS[:n])})") for n in (2, 3, 4)},
    **{f"and{n}": Gate(INPUTS[:n], "q", "&".join(INPUTS[:n])) for n in (2, 3, 4)},
    **{f"nor{n}": Gate(INPUTS[:n], "nq", f"!({'|'.join(INPUTS[:n])})") for n in (2, 3, 4)},
    **{f"or{n}": Gate(INPUTS[:n], "q", "|".join(INPUTS[:n])) for n in (2, 3, 4)},
    "mux2": Gate(("i0", "i1", "cmd"), "q", "(i0&!cmd)|(i1&cmd)"),
    "and21nor": Gate(INPUTS[:3], "nq", "!((i0&i1)|i2)"),
    "or21nand": Gate(INPUTS[:3], "nq", "!((i0|i1)&i2)"),
    "xor2": Gate(INPUTS[:2], "q", "i0^i1"),
    "nexor2": Gate(INPUTS[:2], "q", "!(i0^i1)"),
}
"""Functions by the names of the cells, without the drive strength after the underscore."""

FLOP = "dff_x1"
BUFFER = "buf_x2"

LEFT_OUT = ("nexor2_x0",)
"""Cells with a function that differs from their name: the transistors of ``nexor2_x0`` form an XOR."""


def usable(cells: Iterable[str]) -> list[str]:
    """Return the names of the generated cells that a netlist may use."""
    return [name for name in cells if name.partition("_")[0] in GATES and name not in LEFT_OUT] + [FLOP]


def liberty(names: list[str], areas: Mapping[str, float]) -> str:
    """Return a liberty file of cells, with functions, areas in um^2, and equal delays."""
    cells = [(name, areas[name], GATES.get(name.partition("_")[0])) for name in names]
    return programs.filled("functions.lib", cells=cells)
