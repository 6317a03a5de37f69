"""Write a cell library without conditional energies, because OpenSTA adds up all conditions."""

import copy
import dataclasses
from typing import Any

import numpy as np

from eskin.flow.liberty.entry import Entry
from eskin.flow.liberty.library import Cell, Library

LEFT_OUT = ("cell", "wire_load", "wire_load_selection", "wire_load_table")


def related_pins(cell: Cell) -> list[str]:
    """Return the inputs that cause the energies of a cell's outputs; only the clocks, if a clock causes energies."""
    found = {name for output in cell.outputs for energy in cell.pins[output].energies for name in energy.related}
    return sorted(found & set(cell.clock_pins) or found)


def one_energy_a_pin(library: Library, kinds: set[str], number: int = 0) -> str:
    """Return a library with one mean ``internal_power`` group per pin.

    OpenSTA 2.0 adds up the groups of a pin, whatever their conditions, and weighs each by how often its related pin
    would pass. The condition ``1`` gives a group the weight 1. Wire loads are left out, since OpenSTA would add those,
    and so are the ranges of capacitances, because OpenSTA takes their upper ends.

    ``number``: index of the related pin whose energies the outputs of a cell get. OpenSTA looks up these energies at
    the slew of that pin; without a related pin, at the slew of the output. If the cell has fewer related pins, the
    index starts again at the first.
    """
    group = copy.copy(library.entry.group)
    last = "default_operating_conditions"
    group.attributes = [a for a in group.attributes if not a.name.startswith(("default_wire_load", last))]
    cells = [_one_energy(cell, number) for cell in library.used(kinds)]
    group.groups = [g for g in group.groups if g.group_name not in LEFT_OUT] + cells
    # OpenSTA knows the condition only behind the group that it names.
    condition = library.entry.text(last) or next(iter(library.entry.named("operating_conditions")), "")
    text = str(group).rstrip().removesuffix("}")
    return text + (f'  {last} : "{condition}";\n' if condition else "") + "}\n"


def _one_energy(cell: Cell, number: int) -> Any:
    """Return the Liberty group of a cell with one energy per pin."""
    related = related_pins(cell)
    group = copy.deepcopy(cell.entry.group)
    for name, pin in dataclasses.replace(cell.entry, group=group).named("pin").items():
        pin.group.attributes = [a for a in pin.group.attributes if not a.name.endswith("_capacitance_range")]
        if found := pin.all("internal_power"):
            others = [g for g in pin.group.groups if g.group_name != "internal_power"]
            cause = related[number % len(related)] if related and name in cell.outputs else ""
            mean = _mean([g for g in found if cause in g.text("related_pin").split()] or found)
            if name in cell.outputs:
                mean["when"] = '"1"'
            if cause:
                mean["related_pin"] = f'"{cause}"'
            pin.group.groups = [*others, mean]
    return group


def _mean(groups: list[Entry]) -> Any:
    """Return the mean of the groups with a condition, or of all groups if no group has a condition."""
    chosen = [g for g in groups if g.text("when")] or groups
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
