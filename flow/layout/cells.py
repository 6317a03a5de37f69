"""Standard cells for layouts, verified against their transistors, and their liberty file."""

from collections.abc import Mapping
from typing import NamedTuple

from eskin.flow import programs
from eskin.flow.layout.transistors import SwitchCell, does, stores


class Gate(NamedTuple):
    """Pins of a cell, and its expected function as Liberty text."""

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
"""Cells with names that do not match their function: the transistors of this cell are an XOR."""


class WrongCell(RuntimeError):
    """Raised for a cell whose transistors do not implement its function."""


def usable(cells: Mapping[str, SwitchCell], left_out: tuple[str, ...] = LEFT_OUT) -> list[str]:
    """Return the names of the cells that a netlist may use, after checking all of them."""
    if FLOP not in cells:
        raise WrongCell(f"there is no {FLOP} among the generated cells")
    chosen = [name for name in cells if name.partition("_")[0] in GATES and name not in left_out]
    for name in chosen:
        check(cells[name])
    check(cells[FLOP])
    return [*chosen, FLOP]


def check(cell: SwitchCell) -> None:
    """Check the function of a cell against its transistors."""
    if cell.name == FLOP:
        if not stores(cell, "i", "clk", "q"):
            raise WrongCell(f"{cell.name}: its transistors are no flip-flop of the rising edge")
        return
    gate = GATES[cell.name.partition("_")[0]]
    if set(cell.pins) != {*gate.inputs, gate.output} or not does(cell, *gate):
        raise WrongCell(f"{cell.name}: its transistors are not {gate.output} = {gate.text}")


def liberty(names: list[str], areas: Mapping[str, float]) -> str:
    """Return a liberty file of checked cells, with functions, areas in um^2, and equal delays."""
    cells = [(name, areas[name], GATES.get(name.partition("_")[0])) for name in names]
    return programs.filled("functions.lib", cells=cells)
