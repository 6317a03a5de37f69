"""Tables of a cell library: delays, slews, setup times and energies against slew and load."""

import functools
from bisect import bisect_left
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.flow.liberty.entry import Entry

Floats = NDArray[np.float64]
RISE, FALL = 0, 1
EDGES = {RISE: "rise", FALL: "fall"}


@dataclass(frozen=True)
class Table:
    """Table of up to two variables in SI units, with linear interpolation and extrapolation."""

    # slew_s, load_f, values: shapes (n,), (m,) and (n, m); one grid point if the table does not depend on a variable
    slew_s: Floats
    load_f: Floats
    values: Floats

    def at(self, slew_s: Any, load_f: Any) -> Any:
        """Return the value at given slews and loads; a pair of floats is computed without NumPy, ten times as fast."""
        if isinstance(slew_s, float) and isinstance(load_f, float):
            slews, loads, rows = self._lists
            low, high, part = _place_one(slews, slew_s)
            left, right, share = _place_one(loads, load_f)
            corners = rows[low][left], rows[low][right], rows[high][left], rows[high][right]
        else:
            low, high, part = _place(self.slew_s, slew_s)
            left, right, share = _place(self.load_f, load_f)
            v = self.values
            corners = v[low, left], v[low, right], v[high, left], v[high, right]
        below = corners[0] * (1 - share) + corners[1] * share
        above = corners[2] * (1 - share) + corners[3] * share
        return below * (1 - part) + above * part

    @functools.cached_property
    def _lists(self) -> tuple[list[float], list[float], list[list[float]]]:
        return self.slew_s.tolist(), self.load_f.tolist(), self.values.tolist()


def _place_one(grid: list[float], value: float) -> tuple[int, int, float]:
    """Return the result of ``_place`` for one value."""
    if len(grid) == 1:
        return 0, 0, 0.0
    low = min(max(bisect_left(grid, value) - 1, 0), len(grid) - 2)
    return low, low + 1, (value - grid[low]) / (grid[low + 1] - grid[low])


def _place(grid: Floats, values: Any) -> tuple[Any, Any, Any]:
    """Return the lower and the upper grid index for interpolation, and the weight of the upper grid point."""
    if len(grid) == 1:
        none = np.zeros(np.shape(values), np.int64)
        return none, none, none
    low = np.minimum(np.maximum(np.searchsorted(grid, values) - 1, 0), len(grid) - 2)
    return low, low + 1, (values - grid[low]) / (grid[low + 1] - grid[low])


@dataclass(frozen=True)
class Scales:
    """Units and table templates of a library."""

    # time, capacitance, leakage, voltage: units in s, F, W and V
    time: float
    capacitance: float
    leakage: float
    voltage: float
    capacitance_f: float = 0.0  # default capacitance of an input
    templates: dict[str, Entry] = field(default_factory=dict, repr=False)

    @property
    def energy(self) -> float:
        """Unit of energy in joules."""
        return self.capacitance * self.voltage**2


@dataclass(frozen=True)
class Energy:
    """Internal energies of one ``internal_power`` group."""

    related: frozenset[str]  # inputs that cause the transition of an output; empty for an input pin
    when: str  # condition; empty for all other cases
    tables: dict[int, Table]  # for ``RISE`` and ``FALL`` of the pin, in joules


@dataclass(frozen=True)
class Arc:
    """Timing arc through a cell."""

    start: str
    end: str
    # kind, sense: ``timing_type`` and ``timing_sense``
    kind: str
    sense: str
    # delay, slew: by output edge
    delay: dict[int, Table]
    slew: dict[int, Table]

    def sources(self, edge: int) -> tuple[int, ...]:
        """Return the input edges that cause an output edge."""
        if self.kind in ("rising_edge", "falling_edge"):
            return (RISE,) if self.kind == "rising_edge" else (FALL,)
        return {"positive_unate": (edge,), "negative_unate": (1 - edge,)}.get(self.sense, (RISE, FALL))

    @property
    def edges(self) -> list[tuple[int, int]]:
        """Pairs of input edge and output edge."""
        return [(into, out) for into in EDGES for out in self.delay if into in self.sources(out)]


def read_table(group: Entry, scales: Scales, unit: float) -> Table:
    """Return the table of a group, with its variables in standard order."""
    values = group.numbers("values")
    template = scales.templates.get(group.names(1)[0]) if group.group.args else None
    grids, axes = [], []
    for number in (1, 2, 3):
        variable = template.text(f"variable_{number}") if template else ""
        if template and variable and values.size > 1:
            grid = (group if group.value(f"index_{number}") else template).numbers(f"index_{number}").ravel()
            axes.append("load" if "capacitance" in variable else "clock" if "related" in variable else "slew")
            grids.append(grid * (scales.capacitance if axes[-1] == "load" else scales.time))
    shape = [len(grid) for grid in grids]
    if len(set(axes)) != len(axes) or int(np.prod(shape)) != values.size or any((np.diff(g) <= 0).any() for g in grids):
        raise group.wrong("the values", "do not fit the template")
    table = values.reshape(shape) * unit
    if "clock" in axes:
        table = table.take([0], axes.index("clock"))
    if axes == ["load", "slew"]:
        table = table.T
    known = dict(zip(axes, grids, strict=True))
    slew, load = (known.get(axis, np.zeros(1)) for axis in ("slew", "load"))
    return Table(slew, load, np.ascontiguousarray(table.reshape(len(slew), len(load))))
