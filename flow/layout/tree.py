"""The clock tree that Coriolis adds to a circuit, and a proof that nothing else changed."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from eskin.flow.layout.cells import FLOP
from eskin.flow.layout.circuit import Circuit

CLOCK, BUFFERS = "clk", "spare_buffer_"
"""Port of the clock, and the beginning of the names that Coriolis gives its buffers."""


@dataclass(frozen=True)
class ClockTree:
    """Clock buffers between the clock port and the flops."""

    buffers: int
    # levels: buffers from the port to a flop, fewest and most
    levels: tuple[int, int]
    most_pins: int  # largest number of pins that the port or a buffer drives


def tree_of(circuit: Circuit, placed: Circuit) -> ClockTree | None:
    """Return the clock tree of a placed circuit; None if the circuit without the tree is another.

    Without its buffers, a placed circuit must have the same cells at the same wires: so a proof of ``circuit`` holds.
    """
    above = {}  # the wire that drives each wire of the tree
    for name, (_, pins) in placed.cells.items():
        if name.startswith(BUFFERS):
            above[pins["q"]] = pins["i"]
    paths = {wire: _path(wire, above) for wire in placed.wires}
    cells = [cell for name, cell in placed.cells.items() if not name.startswith(BUFFERS)]
    if _cells([(kind, {pin: paths[wire][-1] for pin, wire in pins.items()}) for kind, pins in cells]) != _cells(
        list(circuit.cells.values())
    ):
        return None
    if any(paths[wire][-1] != CLOCK for wire in above):
        return None
    levels = [len(paths[pins["clk"]]) - 1 for kind, pins in cells if kind == FLOP]
    driven = Counter(wire for _, pins in placed.cells.values() for pin, wire in pins.items() if pin != "q")
    return ClockTree(len(above), (min(levels), max(levels)), max(driven[wire] for wire in {CLOCK, *above}))


def _path(wire: str, above: dict[str, str]) -> list[str]:
    """Return a wire and the wires that drive it through buffers of the tree."""
    path = [wire]
    while path[-1] in above and len(path) <= len(above):
        path.append(above[path[-1]])
    return path


def _cells(cells: list[tuple[str, dict[str, str]]]) -> Counter[tuple[str, tuple[tuple[str, str], ...]]]:
    """Return cells with their wires, without names of instances, which the layout tools do not keep."""
    return Counter((kind, tuple(sorted(pins.items()))) for kind, pins in cells)
