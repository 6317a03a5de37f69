"""Write a cell library without conditional energies, because OpenSTA adds up all conditions."""

from __future__ import annotations

import copy
import dataclasses
from typing import Any

import numpy as np

from eskin.flow.liberty.entry import Entry
from eskin.flow.liberty.library import Cell, Library

LEFT_OUT = ("cell", "wire_load", "wire_load_selection", "wire_load_table")


def one_energy_a_pin(library: Library, kinds: set[str]) -> str:
    """Return a library with one mean ``internal_power`` group per pin.

    OpenSTA 2.0 adds up the groups of a pin, whatever their conditions, and weighs each by how often its related pin
    would pass. Wire loads are left out, since it would add those, and so are the ranges of capacitances, of which it
    takes the upper ends.

    Parameters
    ----------
    library : Library
    kinds : set of str
        Names of the cells.
    """
    group = copy.copy(library.entry.group)
    last = "default_operating_conditions"
    group.attributes = [a for a in group.attributes if not a.name.startswith(("default_wire_load", last))]
    cells = [_one_energy(cell) for cell in library.used(kinds)]
    group.groups = [g for g in group.groups if g.group_name not in LEFT_OUT] + cells
    # OpenSTA knows the condition only behind the group that it names.
    condition = library.entry.text(last) or next(iter(library.entry.named("operating_conditions")), "")
    text = str(group).rstrip().removesuffix("}")
    return text + (f'  {last} : "{condition}";\n' if condition else "") + "}\n"


def _one_energy(cell: Cell) -> Any:
    """Return the Liberty group of a cell with one energy per pin."""
    group = copy.deepcopy(cell.entry.group)
    for pin in dataclasses.replace(cell.entry, group=group).all("pin"):
        pin.group.attributes = [a for a in pin.group.attributes if not a.name.endswith("_capacitance_range")]
        if found := pin.all("internal_power"):
            others = [g for g in pin.group.groups if g.group_name != "internal_power"]
            pin.group.groups = [*others, _mean(found, cell.clock_pins)]
    return group


def _mean(groups: list[Entry], clocks: list[str]) -> Any:
    """Return one group that is the mean of groups: those caused by a clock, else conditional ones, else all."""
    chosen = [g for g in groups if g.text("related_pin") in clocks] or [g for g in groups if g.text("when")] or groups
    first = copy.deepcopy(chosen[0].group)
    first.attributes = [a for a in first.attributes if a.name not in ("when", "related_pin")]
    by_edge = [[table for g in chosen for table in g.all(f"{edge}_power")] for edge in ("rise", "fall")]
    first.groups = [_mean_table(tables) for tables in by_edge if tables]
    return first


def _mean_table(tables: list[Entry]) -> Any:
    """Return the mean of tables on one grid."""
    values = [table.numbers("values") for table in tables]
    largest = max(range(len(values)), key=lambda number: values[number].size)
    base, shape = copy.deepcopy(tables[largest].group), values[largest].shape
    mean = np.mean(
        [v.reshape(shape) if v.size == values[largest].size else np.full(shape, v.mean()) for v in values], 0
    )
    kind = type(base["values"][0])
    base["values"] = [kind(", ".join(f"{value:.8g}" for value in row)) for row in mean]
    return base
