"""Tables of a library: energies and transition times by slew and load, and the conditions under which each holds."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flow.asic.library import number_of, text_of
from flow.gates.liberty import CellLibrary, LibraryCell, verilog_of

Bits = NDArray[np.bool_]
ENERGY_UNIT = "capacitance times square of voltage"
RISE, FALL = "rise", "fall"


@dataclass(frozen=True)
class Table:
    """A table of up to two variables, in SI units, continued at its ends as straight lines.

    Attributes
    ----------
    slew_s, load_f : ndarray, shape (n,) and (m,)
        Its grid; one point where it does not depend on that variable.
    values : ndarray, shape (n, m)
    """

    slew_s: NDArray[np.float64]
    load_f: NDArray[np.float64]
    values: NDArray[np.float64]

    def at(self, slew_s: float, load_f: float) -> float:
        """Return the value at a slew and a load."""
        low, high, part = _place(self.slew_s, slew_s)
        left, right, share = _place(self.load_f, load_f)
        v = self.values
        below = v[low, left] * (1 - share) + v[low, right] * share
        above = v[high, left] * (1 - share) + v[high, right] * share
        return float(below * (1 - part) + above * part)


def _place(grid: NDArray[np.float64], value: float) -> tuple[int, int, float]:
    """Return the two points of a grid between which a value is interpolated, and its share of the second."""
    if len(grid) == 1:
        return 0, 0, 0.0
    low = min(max(int(np.searchsorted(grid, value)) - 1, 0), len(grid) - 2)
    return low, low + 1, (value - float(grid[low])) / float(grid[low + 1] - grid[low])


@dataclass(frozen=True)
class Energy:
    """Energies of one ``internal_power`` group.

    Attributes
    ----------
    related : frozenset of str
        Inputs whose change causes that of an output; empty at an input's own group.
    when : str
        Condition; empty where it is the one for all other cases.
    tables : dict of str to Table
        For ``rise`` and ``fall`` of the pin, in joules.
    """

    related: frozenset[str]
    when: str
    tables: dict[str, Table]


@dataclass(frozen=True)
class Arc:
    """A way from an input to an output: the sense of it, and the output's transition times."""

    related: str
    sense: str
    edge: str
    tables: dict[str, Table]


@dataclass(frozen=True)
class CellTables:
    """What the library says of the power of a cell.

    Attributes
    ----------
    cell : LibraryCell
    leakage_w : float
        Without a state.
    states : list of (str, float)
        Conditions, and the leakage under each in watts.
    energies : dict of str to list of Energy
        Of every pin.
    arcs : dict of str to list of Arc
        Into every output.
    capacitance_f : dict of str to float
        Of every input.
    """

    cell: LibraryCell
    leakage_w: float
    states: list[tuple[str, float]]
    energies: dict[str, list[Energy]]
    arcs: dict[str, list[Arc]]
    capacitance_f: dict[str, float]

    @classmethod
    def read(cls, library: CellLibrary, cell: LibraryCell) -> CellTables:
        """Return the tables of a cell."""
        units, group = library.known.units, cell.group
        joule = units["capacitance"] * units["voltage"] ** 2
        states = [
            (text_of(g["when"]), number_of(g["value"]) * units["leakage"]) for g in group.get_groups("leakage_power")
        ]
        energies, arcs, capacitance = {}, {}, {}
        for name, pin in cell.pins.items():
            energies[name] = [_energy(library, g, joule) for g in pin.get_groups("internal_power")]
            arcs[name] = [arc for g in pin.get_groups("timing") for arc in _arcs(library, g)]
            if text_of(pin["direction"]) == "input":
                default = number_of(library.group["default_input_pin_cap"])
                capacitance[name] = number_of(pin["capacitance"], default) * units["capacitance"]
        plain = [power for when, power in states if not when]
        leakage = number_of(group["cell_leakage_power"]) * units["leakage"]
        if group["cell_leakage_power"] is None and states:
            leakage = plain[0] if plain else sum(power for _, power in states) / len(states)
        return cls(cell, leakage, [s for s in states if s[0]], energies, arcs, capacitance)


def _energy(library: CellLibrary, group: Any, joule: float) -> Energy:
    tables = {}
    both = group.get_groups("power")
    for edge in (RISE, FALL):
        found = group.get_groups(f"{edge}_power") or both
        if found:
            tables[edge] = table_of(library, found[0], joule)
    return Energy(frozenset(text_of(group["related_pin"]).split()), text_of(group["when"]), tables)


def _arcs(library: CellLibrary, group: Any) -> list[Arc]:
    kind = text_of(group["timing_type"])
    tables = {
        edge: table_of(library, found[0], library.known.units["time"])
        for edge in (RISE, FALL)
        if (found := group.get_groups(f"{edge}_transition"))
    }
    edge = {"rising_edge": RISE, "falling_edge": FALL}.get(kind, "")
    related = text_of(group["related_pin"]).split()
    return [Arc(pin, text_of(group["timing_sense"]), edge, tables) for pin in related] if tables else []


def numbers(value: Any) -> NDArray[np.float64]:
    rows = value if isinstance(value, list) else [value]
    return np.array([[float(word) for word in text_of(row).replace(",", " ").split()] for row in rows])


def table_of(library: CellLibrary, group: Any, unit: float) -> Table:
    """Return the table of a group, whichever of its variables comes first."""
    template = library.templates.get(text_of(group.args[0])) if group.args else None
    values = numbers(group["values"]) * unit
    variables, grids = [], []
    for number in (1, 2):
        variable = text_of(template[f"variable_{number}"]) if template is not None else ""
        index = group[f"index_{number}"] or (template[f"index_{number}"] if template is not None else None)
        if variable and index is not None and values.size > 1:
            by_load = "capacitance" in variable
            variables.append("load" if by_load else "slew")
            grids.append(numbers(index).ravel() * library.known.units["capacitance" if by_load else "time"])
    one = np.zeros(1)
    if not variables:
        return Table(one, one, values.reshape(-1)[:1].reshape(1, 1))
    shaped = values.reshape([len(grid) for grid in grids])
    if variables == ["load", "slew"]:
        return Table(grids[1], grids[0], shaped.T)
    if variables == ["slew", "load"]:
        return Table(grids[0], grids[1], shaped)
    return Table(grids[0], one, shaped[:, None]) if variables == ["slew"] else Table(one, grids[0], shaped[None, :])


@functools.cache
def condition(text: str) -> Callable[[dict[str, Bits]], Bits]:
    """Return a condition as a function of the bits of the pins."""
    words = verilog_of(text).replace("1'b1", "True_").replace("1'b0", "False_")
    code = compile(words, text, "eval")
    constants = {"__builtins__": {}, "True_": np.bool_(True), "False_": np.bool_(False)}
    return lambda pins: eval(code, constants, pins)
