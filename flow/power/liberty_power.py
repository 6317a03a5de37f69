"""Compute the power of a netlist from Liberty tables: leakage, internal energy and switching energy."""

import graphlib
from dataclasses import dataclass, field

import numpy as np

from eskin.flow.gatesim.flat_netlist import Cell, FlatNetlist
from eskin.flow.liberty.boolean import Bits, evaluate
from eskin.flow.liberty.library import Cell as Kind
from eskin.flow.liberty.library import Library
from eskin.flow.liberty.tables import FALL, RISE, Arc, Energy
from eskin.flow.power.activity import Activity

INPUT_SLEW_S = 0.1e-9
"""Transition time at the inputs of the netlist."""


@dataclass(frozen=True)
class CellActivity:
    """Activity of a cell, independent of its loads."""

    leakage_w: float  # mean over the recorded states
    spent: list[tuple[str, int, Energy, float]]  # pin, edge, energy of the library, and number of times


@dataclass
class LibertyPower:
    """Power model of a netlist with loads and slews."""

    netlist: FlatNetlist
    library: Library
    wires_f: dict[str, float]  # wire capacitance of every net
    kinds: dict[str, Kind] = field(init=False)
    load_f: dict[str, float] = field(init=False)
    slew_s: dict[str, dict[int, float]] = field(init=False)

    def __post_init__(self) -> None:
        self.kinds = {kind.name: kind for kind in self.library.used({cell.kind for cell in self.netlist.cells})}
        self.load_f = dict(self.wires_f)
        for cell in self.netlist.cells:
            for pin in self.kinds[cell.kind].inputs:
                if pin in cell.pins:
                    more = self.kinds[cell.kind].pins[pin].capacitance_f
                    self.load_f[cell.pins[pin]] = self.load_f.get(cell.pins[pin], 0.0) + more
        self.slew_s = self._slews()

    def _slews(self) -> dict[str, dict[int, float]]:
        """Return rise and fall times of every net, the longest over all timing arcs."""
        driver = {net: cell for cell in self.netlist.cells for net in self._outputs(cell).values()}
        before = {}
        for cell in self.netlist.cells:
            arcs = [arc for pin in self._outputs(cell) for arc in self._into(cell, pin)]
            kind = self.kinds[cell.kind]
            is_latch = kind.memory and not kind.memory.is_flop  # a latch ends a path
            related = {arc.start for arc in arcs if not is_latch or arc.start in kind.clock_pins}
            nets = {cell.pins[pin] for pin in related if pin in cell.pins}
            before[cell.name] = {driver[net].name for net in nets if net in driver}
        named = {cell.name: cell for cell in self.netlist.cells}
        slews: dict[str, dict[int, float]] = {}
        for name in graphlib.TopologicalSorter(before).static_order():
            for pin, net in self._outputs(named[name]).items():
                slews[net] = self._slew(named[name], pin, slews)
        return slews

    def _slew(self, cell: Cell, pin: str, slews: dict[str, dict[int, float]]) -> dict[int, float]:
        load = self.load_f.get(cell.pins[pin], 0.0)
        found = {RISE: 0.0, FALL: 0.0}
        for arc in self._into(cell, pin):
            given = slews.get(cell.pins.get(arc.start, ""), {})
            for edge, table in arc.slew.items():
                for source in arc.sources(edge):
                    found[edge] = max(found[edge], table.at(given.get(source, INPUT_SLEW_S), load))
        return found

    def _into(self, cell: Cell, pin: str) -> list[Arc]:
        return [arc for arc in self.kinds[cell.kind].pins[pin].arcs if arc.slew]

    def _outputs(self, cell: Cell) -> dict[str, str]:
        return {pin: cell.pins[pin] for pin in self.kinds[cell.kind].outputs if pin in cell.pins}

    def _slew_of(self, cell: Cell, pin: str, edge: int) -> float:
        return self.slew_s.get(cell.pins.get(pin, ""), {}).get(edge, INPUT_SLEW_S)

    def power_w(
        self, activity: Activity, clock_hz: float, uses: dict[str, CellActivity] | None = None
    ) -> dict[str, tuple[float, float, float]]:
        """Return internal, switching and leakage power of every cell in watts; known ``uses`` save half the time."""
        known = self.uses(activity) if uses is None else uses
        return {cell.name: self._power(cell, activity, clock_hz, known[cell.name]) for cell in self.netlist.cells}

    def uses(self, activity: Activity) -> dict[str, CellActivity]:
        """Return the activity of every cell, which does not depend on wires."""
        return {cell.name: self._use(cell, activity) for cell in self.netlist.cells}

    def inputs_w(self, activity: Activity, clock_hz: float) -> float:
        """Return the power to drive the input ports, clock and reset: C V^2 / 2 per toggle."""
        nets = dict.fromkeys(net for port in self.netlist.ports if port.direction == "input" for net in port.nets)
        return sum(self._switching(net, activity) for net in nets) * clock_hz

    def stateless_w(self) -> float:
        """Return the leakage of all cells, averaged over all states."""
        return sum(self.kinds[cell.kind].leakage_w for cell in self.netlist.cells)

    def _switching(self, net: str, activity: Activity) -> float:
        return 0.5 * self.load_f.get(net, 0.0) * self.library.voltage_v**2 * activity.toggles(net)

    def _power(self, cell: Cell, activity: Activity, clock_hz: float, use: CellActivity) -> tuple[float, float, float]:
        outputs = self._outputs(cell)
        switching = sum(self._switching(net, activity) for net in outputs.values())
        internal = 0.0
        for pin, edge, energy, count in use.spent:
            load = self.load_f.get(cell.pins[pin], 0.0) if pin in outputs else 0.0
            internal += count * self._value(cell, pin, edge, energy, load) / activity.clocks
        return internal * clock_hz, switching * clock_hz, use.leakage_w

    def _use(self, cell: Cell, activity: Activity) -> CellActivity:
        kind = self.kinds[cell.kind]
        bits = {pin: _bits(net, activity) for pin, net in cell.pins.items()}
        outputs = self._outputs(cell)
        spent: list[tuple[str, int, Energy, float]] = []
        for pin in cell.pins:
            if len(bits[pin]) > 1 and kind.pins[pin].energies:
                spent += self._spent(cell, pin, bits, pin in outputs)
        return CellActivity(self._leakage(kind, bits), spent)

    def _leakage(self, kind: Kind, bits: dict[str, Bits]) -> float:
        """Return the leakage of a cell, averaged over its recorded states."""
        if not kind.leakage_states:
            return kind.leakage_w
        known = _with_outputs(kind, bits)
        total, share = 0.0, 0.0
        for when, power in kind.leakage_states:
            held = evaluate(when, known)
            part = np.count_nonzero(held) / held.size
            total += part * power
            share += part
        return total / share if share > 0.999 else total + (1 - share) * kind.leakage_w

    def _spent(self, cell: Cell, pin: str, bits: dict[str, Bits], output: bool) -> list[tuple[str, int, Energy, float]]:
        """Return the internal energies of a pin's transitions, and their counts."""
        kind = self.kinds[cell.kind]
        clocks = kind.clock_pins
        after, before = bits[pin][1:], bits[pin][:-1]
        known = _with_outputs(kind, bits)
        # A clock edge uses the values before the edge; data changes use the clock level after the edge.
        shown = {
            name: values if len(values) == 1 else (values[:-1] if pin in clocks and name != pin else values[1:])
            for name, values in known.items()
        }
        spent = []
        for edge, changed in ((RISE, after & ~before), (FALL, before & ~after)):
            if changed.any():
                groups = [group for group in kind.pins[pin].energies if edge in group.tables]
                counts = _counts(groups, (changed, shown, bits, output))
                spent += [(pin, edge, group, count) for group, count in zip(groups, counts, strict=True) if count]
        return spent

    def _value(self, cell: Cell, pin: str, edge: int, group: Energy, load: float) -> float:
        """Return the energy of one transition from the group's table."""
        if not group.related:
            return group.tables[edge].at(self._slew_of(cell, pin, edge), load)
        values = []
        for related in group.related:
            arcs = [arc for arc in self._into(cell, pin) if arc.start == related]
            sources = {s for arc in arcs for s in arc.sources(edge)} or {edge}
            values += [group.tables[edge].at(self._slew_of(cell, related, s), load) for s in sources]
        return sum(values) / len(values)


def _counts(groups: list[Energy], seen: tuple[Bits, dict[str, Bits], dict[str, Bits], bool]) -> list[float]:
    """Return the number of times that each group applies to the rises or falls of a pin.

    A change costs the mean of those that fit it; where none does, the mean of those without a condition.
    """
    changed, shown, bits, output = seen
    at = np.flatnonzero(changed)
    fits = np.zeros((len(groups), len(at)), bool)
    spare = np.array([not group.when or output for group in groups], bool)
    for number, group in enumerate(groups):
        if not (group.when or output):
            continue
        fits[number] = True
        if group.when:
            fits[number] &= np.broadcast_to(evaluate(group.when, shown), changed.shape)[at]
        if output and group.related:
            moved = [bits[name] for name in group.related if len(bits.get(name, ())) > 1]
            fits[number] &= np.any([m[1:][at] != m[:-1][at] for m in moved], axis=0) if moved else False
    fitting = fits.sum(axis=0)
    counts = (fits / np.maximum(fitting, 1)).sum(axis=1)
    others = float(np.count_nonzero(fitting == 0)) / max(int(np.count_nonzero(spare)), 1)
    return [float(count) for count in counts + others * spare]


def _bits(net: str, activity: Activity) -> Bits:
    """Return the recorded values of a net or a constant."""
    return np.array([net == "1'b1"]) if net.startswith("1'b") else activity.values[net]


def _with_outputs(kind: Kind, bits: dict[str, Bits]) -> dict[str, Bits]:
    """Return the values of all pins for conditions; unconnected outputs count as low."""
    return {pin: bits.get(pin, np.zeros(1, bool)) for pin in kind.pins}
