"""A cell library without conditions, for a tool that adds up the energies of all of them."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flow.asic.library import text_of
from flow.gates.liberty import CellLibrary, LibraryCell

LEFT_OUT = ("wire_load", "wire_load_selection", "wire_load_table")


def plain(library: CellLibrary, kinds: set[str]) -> str:
    """Return a library of some cells in which every pin has one ``internal_power`` group: the mean of its own.

    OpenSTA 2.0 adds up the groups of a pin, whatever their conditions, and weighs each by how often its related pin
    would pass. Wire loads are left out, since it would add those, and so are the ranges of capacitances, of which it
    takes the upper ends.

    Parameters
    ----------
    library : CellLibrary
    kinds : set of str
        Names of the cells.
    """
    group = copy.copy(library.group)
    last = "default_operating_conditions"
    group.attributes = [a for a in group.attributes if not a.name.startswith(("default_wire_load", last))]
    cells = [_plain_cell(cell) for cell in library.used(kinds)]
    group.groups = [g for g in group.groups if g.group_name not in ("cell", *LEFT_OUT)] + cells
    condition = text_of(library.group[last])  # OpenSTA knows it only behind the group that it names
    if not condition and (named := library.group.get_groups("operating_conditions")):
        condition = text_of(named[0].args[0])
    text = str(group).rstrip().removesuffix("}")
    return text + (f'  {last} : "{condition}";\n' if condition else "") + "}\n"


def _plain_cell(cell: LibraryCell) -> Any:
    group = copy.deepcopy(cell.group)
    for pin in group.get_groups("pin"):
        pin.attributes = [a for a in pin.attributes if not a.name.endswith("_capacitance_range")]
        found = pin.get_groups("internal_power")
        if found:
            pin.groups = [g for g in pin.groups if g.group_name != "internal_power"] + [_mean(found, cell.clock_pins)]
    return group


def _mean(groups: list[Any], clocks: list[str]) -> Any:
    """Return one group for several: of those with a condition, or of those that a clock causes, where there are any."""
    chosen = [g for g in groups if text_of(g["related_pin"]) in clocks] or [g for g in groups if g["when"]] or groups
    first = copy.deepcopy(chosen[0])
    first.attributes = [a for a in first.attributes if a.name not in ("when", "related_pin")]
    first.groups = [_mean_table([t for g in chosen for t in g.get_groups(f"{e}_power")]) for e in ("rise", "fall")]
    first.groups = [table for table in first.groups if table is not None]
    return first


def _mean_table(tables: list[Any]) -> Any:
    """Return the mean of tables on one grid; a scalar counts as a table that is the same everywhere."""
    if not tables:
        return None
    base = copy.deepcopy(max(tables, key=lambda table: _values(table).size))
    shape = _values(base).shape
    mean = np.mean(
        [
            np.broadcast_to(_values(t) if _values(t).size == _values(base).size else _values(t).mean(), shape)
            for t in tables
        ],
        axis=0,
    )
    kind = type(base["values"][0])
    base["values"] = [kind(", ".join(f"{value:.8g}" for value in row)) for row in mean]
    return base


def _values(table: Any) -> NDArray[np.float64]:
    rows = table["values"] if isinstance(table["values"], list) else [table["values"]]
    return np.array([[float(word) for word in text_of(row).replace(",", " ").split()] for row in rows])
