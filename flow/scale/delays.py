"""Delays of cells from the tables of a library, for many cells at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flow.asic.library import number_of, text_of
from flow.gates.liberty import CellLibrary, LibraryCell
from flow.power.tables import FALL, RISE, Table, table_of

Floats = NDArray[np.float64]
EDGES = (RISE, FALL)


@dataclass(frozen=True)
class Arc:
    """A way through a cell.

    Attributes
    ----------
    start, end : str
        Input and output pin.
    edges : tuple of (int, int)
        Edges in and out that belong together, 0 rising and 1 falling.
    delay, slew : dict of int to Table
        Of the edge out, by edge.
    """

    start: str
    end: str
    edges: tuple[tuple[int, int], ...]
    delay: dict[int, Table]
    slew: dict[int, Table]


@dataclass(frozen=True)
class Kind:
    """A library cell as the timing sees it.

    Attributes
    ----------
    name : str
    area_um2 : float
    loads : dict of str to float
        Capacitance of every input in farad.
    outputs : tuple of str
    clock : str
        Clock pin of a flop or clock gate, else empty.
    arcs : tuple of Arc
        Through the cell; out of the clock where it has one.
    setup : dict of str to dict of int to Table
        Of the data pins: by edge, over the slew of the data at a steep clock.
    """

    name: str
    area_um2: float
    loads: dict[str, float]
    outputs: tuple[str, ...]
    clock: str
    arcs: tuple[Arc, ...]
    setup: dict[str, dict[int, Table]]

    def through(self, slew_s: float, loads_f: Floats) -> tuple[Floats, Floats]:
        """Return the worst delay and the worst slew of its ways at a slew, for some loads."""
        slews = np.full(len(loads_f), slew_s)
        ways = [(arc.delay[e], arc.slew[e]) for arc in self.arcs for _, e in arc.edges]
        delays = [look(delay, slews, loads_f) for delay, _ in ways]
        return np.max(delays, axis=0), np.max([look(slew, slews, loads_f) for _, slew in ways], axis=0)


def kind_of(library: CellLibrary, cell: LibraryCell) -> Kind:
    """Return a cell of a library with its tables."""
    known = library.known.cells[cell.name]
    clocks = cell.clock_pins if cell.is_flop or cell.clock_gate else []
    outputs = tuple(cell.of_direction("output"))
    arcs, setup = [], {}
    for name, pin in cell.pins.items():
        for group in pin.get_groups("timing"):
            related, kind = text_of(group["related_pin"]).split(), text_of(group["timing_type"])
            if name in outputs:
                arcs += [a for start in related if (a := _arc(library, group, start, name, kind))]
            elif kind == "setup_rising":
                setup[name] = {e: _check(library, g) for e, g in _by_edge(group, "{}_constraint")}
    # A pin loads as much as it does at the worse of the two edges.
    loads = {
        name: max(
            [
                load,
                *(number_of(cell.pins[name][f"{e}_capacitance"]) * library.known.units["capacitance"] for e in EDGES),
            ]
        )
        for name, load in known.inputs.items()
    }
    wanted = [a for a in arcs if not clocks or a.start == clocks[0]]
    return Kind(cell.name, known.area_um2, loads, outputs, next(iter(clocks), ""), tuple(wanted), setup)


def _by_edge(group: Any, name: str) -> list[tuple[int, Any]]:
    return [(e, found[0]) for e, edge in enumerate(EDGES) if (found := group.get_groups(name.format(edge)))]


def _arc(library: CellLibrary, group: Any, start: str, end: str, kind: str) -> Arc | None:
    """Return a way of a timing group; none where it is that of a reset, or no delay."""
    delay = {e: table_of(library, g, library.known.units["time"]) for e, g in _by_edge(group, "cell_{}")}
    slew = {e: table_of(library, g, library.known.units["time"]) for e, g in _by_edge(group, "{}_transition")}
    if not delay or kind not in ("", "combinational", "rising_edge"):
        return None
    sense = text_of(group["timing_sense"])
    if kind == "rising_edge":
        pairs = [(0, 0), (0, 1)]
    else:
        pairs = [(i, o) for i in (0, 1) for o in (0, 1) if sense == "non_unate" or (i == o) == (sense[0] == "p")]
    return Arc(start, end, tuple((i, o) for i, o in pairs if o in delay), delay, slew)


def _check(library: CellLibrary, group: Any) -> Table:
    """Return a setup time over the slew of the data, at the steepest clock of the table."""
    from flow.power.tables import numbers

    template = library.templates[text_of(group.args[0])]
    values = numbers(group["values"]) * library.known.units["time"]
    names = [text_of(template[f"variable_{number}"]) for number in (1, 2)]
    grids = [
        numbers(group[f"index_{n}"] or template[f"index_{n}"]).ravel() * library.known.units["time"] for n in (1, 2)
    ]
    values = values.reshape(len(grids[0]), len(grids[1]))
    data = 0 if "constrained" in names[0] else 1
    return Table(grids[data], np.zeros(1), (values[:, :1] if data == 0 else values[:1].T).copy())


def look(table: Table, slew_s: Floats, load_f: Floats) -> Floats:
    """Return the values of a table at many slews and loads; it goes on as straight lines at its ends."""
    low, part = _place(table.slew_s, slew_s)
    left, share = _place(table.load_f, load_f)
    high, right = np.minimum(low + 1, len(table.slew_s) - 1), np.minimum(left + 1, len(table.load_f) - 1)
    v = table.values
    below = v[low, left] * (1 - share) + v[low, right] * share
    above = v[high, left] * (1 - share) + v[high, right] * share
    return np.asarray(below * (1 - part) + above * part)


def _place(grid: Floats, values: Floats) -> tuple[NDArray[np.int64], Floats]:
    if len(grid) == 1:
        return np.zeros(len(values), np.int64), np.zeros(len(values))
    low = np.clip(np.searchsorted(grid, values) - 1, 0, len(grid) - 2)
    return low, (values - grid[low]) / (grid[low + 1] - grid[low])
