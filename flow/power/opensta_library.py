"""Write a cell library without conditional energies, because OpenSTA adds up all conditions."""

import copy
import dataclasses
from typing import Any, NamedTuple

import numpy as np

from eskin.flow.liberty.entry import Entry
from eskin.flow.liberty.library import Cell, Library, Pin
from eskin.flow.liberty.tables import EDGES, FALL, RISE

LEFT_OUT = ("cell", "wire_load", "wire_load_selection", "wire_load_table")


def related_pins(cell: Cell) -> list[str]:
    """Return the inputs that cause the energies of a cell's outputs; only the clocks, if a clock causes energies."""
    found = {name for output in cell.outputs for energy in cell.pins[output].energies for name in energy.related}
    return sorted(found & set(cell.clock_pins) or found)


class Case(NamedTuple):
    """A condition, and the edges of an input, for which a library has an energy of its own."""

    group: int  # index of the ``internal_power`` group
    when: str
    edges: tuple[int, ...]


def cases(pin: Pin) -> list[Case]:
    """Return the cases of an input's energies: every condition and edge, or both edges if there is one condition."""
    every = list(enumerate(pin.energies))
    chosen = [(number, energy) for number, energy in every if energy.when] or every
    if len(chosen) == 1:
        return [Case(chosen[0][0], chosen[0][1].when, (RISE, FALL))]
    return [Case(number, energy.when, (edge,)) for number, energy in chosen for edge in energy.tables]


def one_energy_a_pin(library: Library, kinds: set[str], number: int = 0) -> str:
    """Return a library with one ``internal_power`` group per pin.

    OpenSTA 2.0 adds up the groups of a pin, whatever their conditions, and weighs each by how often its related pin
    would pass. The condition ``1`` gives a group the weight 1. Wire loads are left out, since OpenSTA would add those,
    and so are the ranges of capacitances, because OpenSTA takes their upper ends.

    ``number``: index of the case whose energy an input of a flop, latch or clock gate gets (inputs of other cells get
    the mean), and of the related pin whose mean energy an output gets.
    OpenSTA looks up the energies of an output at the slew of that pin; without a related pin, at the slew of the
    output. If there are fewer cases or related pins, the index starts again at the first.
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
            if name in cell.outputs:
                cause = related[number % len(related)] if related else ""
                one = _mean([g for g in found if cause in g.text("related_pin").split()] or found)
                one["when"] = '"1"'
                if cause:
                    one["related_pin"] = f'"{cause}"'
            else:
                one = _one_case(cell.pins[name], number) if cell.memory else _mean(found)
            pin.group.groups = [*others, one]
    return group


def _one_case(pin: Pin, number: int) -> Any:
    """Return the group of an input's energy in one case, with tables of the edges of this case alone."""
    known = cases(pin)
    case = known[number % len(known)]
    one = copy.deepcopy(pin.entry.all("internal_power")[case.group].group)
    one.attributes = [a for a in one.attributes if a.name not in ("when", "related_pin")]
    if len(case.edges) == 1:
        one.groups = [g for g in one.groups if g.group_name == f"{EDGES[case.edges[0]]}_power"]
    return one


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
