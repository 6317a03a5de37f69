"""Compute the power of a netlist with OpenSTA, scaled by the recorded activity of the pins.

This version of OpenSTA (2.0) reads no activity of single pins. It takes one for all data, and the clock's: so what a
toggle of the clock pin, of the data pins and of the output costs an instance is told apart by four reports, in which
they toggle or not. OpenSTA looks up the energy of an output at the slew of one related pin, and of an input without its
condition, so the reports are repeated for each related pin and each condition; the recorded activity gives the share of
each. The energy of a flop's clock depends on the data and on the stored value, for instance.
"""

from __future__ import annotations

import functools
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.flow import programs
from eskin.flow.gatesim.flat_netlist import Cell, FlatNetlist
from eskin.flow.liberty.boolean import evaluate
from eskin.flow.liberty.library import Cell as Kind
from eskin.flow.liberty.library import Library
from eskin.flow.liberty.tables import FALL, RISE
from eskin.flow.power.activity import Activity
from eskin.flow.power.opensta_library import Case, cases, one_energy_a_pin, related_pins

PERIOD_NS = 1000
PERIOD_S = PERIOD_NS * 1e-9
STILL = 1e-9
"""Activity that counts as no toggles: OpenSTA reports nothing for an activity of 0."""

Report = dict[str, tuple[float, float, float]]
"""Internal, switching and leakage power of every instance in watts."""


@dataclass(frozen=True)
class Costs:
    """Leakage of an instance in watts, and its energy in joules per toggle of each pin."""

    leakage_w: float
    # clock, data: inside the cell, per toggle of the clock pin and of the data pin, by case
    clock: list[float]
    data: list[float]
    output: list[float]  # inside the cell, per output toggle, by the related pin that causes the toggle
    load: float  # in the load, per output toggle


@dataclass
class OpenstaPower:
    """A netlist with the power of its instances from OpenSTA."""

    netlist: FlatNetlist
    library: Library
    wires_f: dict[str, float]
    costs: dict[str, Costs] = field(init=False)

    def __post_init__(self) -> None:
        kinds = list(self.library.used({cell.kind for cell in self.netlist.cells}))
        most = max(max(len(related_pins(kind)), *map(len, self._cases(kind))) for kind in kinds)
        gates = max((len(self._cases(kind)[0]) for kind in kinds if kind.gate), default=0)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            counted = _counted(folder)
            (folder / "netlist.v").write_text(self.netlist.verilog())
            reports: list[list[Report]] = []
            for number in range(max(most, 1)):  # one related pin and one case after the other
                library = one_energy_a_pin(self.library, {kind.name for kind in kinds}, number)
                (folder / "cells.lib").write_text(library)
                lines = [set_up(self.netlist.top), *self._loads(), f"report still {STILL}", "report all 1"]
                reports.append(run([*lines, *self._moving_pins()], folder))
                if number < gates:
                    reports[-1].append(self._gates_alone(folder))
        self.costs = {cell.name: self._costs(cell, reports, counted) for cell in self.netlist.cells}

    def _loads(self) -> list[str]:
        """Return the commands that load the nets with their wires."""
        unit = self.library.scales.capacitance
        return [f"set_load {value / unit:.6g} [get_nets {{{net}}}]" for net, value in self.wires_f.items() if value]

    def _moving_pins(self) -> list[str]:
        """Return the commands that report the power, first with moving data pins, then with all inputs moving."""
        lines = []
        for number, name in enumerate(("data", "rest")):
            pins = [f"{cell.name}/{pin}" for cell in self.netlist.cells for pin in self._pins(cell)[number]]
            if pins:
                lines += [f"create_clock -name {name} -period {PERIOD_NS} [get_pins {{{' '.join(pins)}}}]"]
            lines += [f"report {name} {STILL}"]
        return lines

    def _gates_alone(self, folder: Path) -> Report:
        """Return the power of clock gates with an idle output, from one run per depth."""
        levels: dict[int, list[Cell]] = {}
        for cell in self.netlist.cells:
            if self._gated(cell):
                levels.setdefault(self._depth(cell), []).append(cell)
        found: Report = {}
        for level, cells in levels.items():
            outputs = " ".join(f"{cell.name}/{self._gated(cell)[0]}" for cell in cells)
            # A second clock with a very long period begins at the outputs, so that the outputs hardly move.
            rest = f"create_clock -name rest -period 1e9 [get_pins {{{outputs}}}]"
            (report,) = run([set_up(self.netlist.top), *self._loads(), rest, f"report {level} {STILL}"], folder)
            found |= {cell.name: report[cell.name] for cell in cells}
        return found

    @functools.cached_property
    def _driver(self) -> dict[str, Cell]:
        """Return the cell that drives each net."""
        return {
            cell.pins[pin]: cell
            for cell in self.netlist.cells
            for pin in self.library.cells[cell.kind].outputs
            if pin in cell.pins
        }

    def _depth(self, cell: Cell) -> int:
        """Return the number of clock gates that the clock passes before it reaches this clock gate."""
        gate, depth = self.library.cells[cell.kind].gate, 0
        before = self._driver.get(cell.pins[gate.clock]) if gate else None
        while before is not None:
            depth += bool(self._gated(before))
            known = self.library.cells[before.kind]
            inputs = known.clock_pins or known.inputs
            before = next((self._driver[n] for p in inputs if (n := before.pins.get(p, "")) in self._driver), None)
        return depth

    def _gated(self, cell: Cell) -> list[str]:
        """Return the connected output pin of a clock gate in a list; empty for other cells."""
        gate = self.library.cells[cell.kind].gate
        return [gate.gated] if gate and gate.gated in cell.pins else []

    def _pins(self, cell: Cell) -> tuple[list[str], list[str]]:
        """Return the data pin in a list, and the other non-clock inputs, of a sequential cell."""
        known = self.library.cells[cell.kind]
        if not (known.flop or known.latch or known.gate):
            return [], []
        inputs = [pin for pin in known.inputs if pin in cell.pins and pin not in known.clock_pins]
        charged = [pin for pin in inputs if known.pins[pin].energies]
        data = _data_pin(known)
        return [p for p in charged if p == data], [p for p in charged if p != data]

    def _costs(self, cell: Cell, related: list[list[Report]], counted: Counted) -> Costs:
        """Return the energies of a cell from the OpenSTA reports of its related pins."""
        known, reports = self.library.cells[cell.kind], related[0]
        still, moving, _, rest = (report[cell.name] for report in reports[:4])
        load, clock_load = (moving[1] - still[1]) * PERIOD_S, still[1] * PERIOD_S / 2

        def inner(known: list[Case], after: int, before: int | None = None) -> list[float]:
            """Return the energy of an input's toggle in each case, from the reports with and without these toggles."""
            found = []
            for case, reports in zip(known, related, strict=False):
                watts = reports[after][cell.name][0] - (0 if before is None else reports[before][cell.name][0])
                joules = watts * PERIOD_S / 2 / counted.clock_in  # a clock makes two toggles in a period
                found.append(joules * 2 / len(case.edges))  # per toggle, of which half are in a case of one edge
            return found

        clock_cases, data_cases = self._cases(known)
        by_data = inner(data_cases, 2, 0)
        if self._gated(cell):
            own = reports[4][cell.name][0]
            gated = (still[0] - own) * PERIOD_S / 2 / counted.clock_out
            return Costs(still[2], inner(clock_cases, 4), by_data, [gated], clock_load)
        causes = [(rests[cell.name][0], moves[cell.name][0]) for rests, moves, *_ in related]
        causes = causes[: max(len(related_pins(known)), 1)]
        by_all = [(moves - rests) * PERIOD_S for rests, moves in causes]
        if known.memory:
            by_inputs = (rest[0] - still[0]) * PERIOD_S / 2 / counted.clock_in
            output = [(joules - by_inputs * counted.data_in) / counted.data_out for joules in by_all]
            return Costs(still[2], inner(clock_cases, 0), by_data, output, load)
        if load > 0:
            return Costs(still[2], [], [], [joules / counted.data_out for joules in by_all], load)
        output = [rests * PERIOD_S / 2 / counted.clock_out for rests, _ in causes]
        return Costs(still[2], [], [], output, clock_load)  # a gate in the clock network

    def power_w(self, activity: Activity, clock_hz: float) -> dict[str, tuple[float, float, float]]:
        """Return internal, switching and leakage power of every cell in watts."""
        return {cell.name: self._power(cell, activity, clock_hz) for cell in self.netlist.cells}

    def _power(self, cell: Cell, activity: Activity, clock_hz: float) -> tuple[float, float, float]:
        known, costs = self.library.cells[cell.kind], self.costs[cell.name]

        def toggles(pins: list[str]) -> float:
            nets = [cell.pins[pin] for pin in pins if pin in cell.pins]
            found = [activity.toggles(net) for net in nets if not net.startswith("1'b")]
            return float(np.mean(found)) if found else 0.0

        caused = float(np.dot(costs.output, self._shares(cell, len(costs.output), activity)))
        internal = caused * toggles(known.outputs)
        pins = [known.clock_pins, self._pins(cell)[0]]
        for causes, joules, each in zip(pins, (costs.clock, costs.data), self._cases(known), strict=True):
            if causes and joules:
                internal += toggles(causes) * float(np.dot(joules, self._case_shares(cell, causes[0], each, activity)))
        return internal * clock_hz, costs.load * toggles(known.outputs) * clock_hz, costs.leakage_w

    def _cases(self, known: Kind) -> tuple[list[Case], list[Case]]:
        """Return the cases of the energies of clock pin and data pin; empty for a cell without state."""
        pins = [*known.clock_pins[:1], _data_pin(known)] if known.memory or known.gate else []
        clock, data = ([] if pin not in known.pins else cases(known.pins[pin]) for pin in (pins or ["", ""]))
        return clock, data

    def _case_shares(self, cell: Cell, pin: str, known: list[Case], activity: Activity) -> NDArray[np.float64]:
        """Return the share of an input's toggles in each case.

        A condition holds before an edge of a clock, and after an edge of data.
        """
        kind = self.library.cells[cell.kind]
        bits = {name: activity.values.get(cell.pins.get(name, ""), np.zeros(1, bool)) for name in kind.pins}
        bits |= {name: np.array([net == "1'b1"]) for name, net in cell.pins.items() if net.startswith("1'b")}
        at = np.flatnonzero(bits[pin][1:] != bits[pin][:-1])
        if not len(at):
            return np.zeros(len(known))
        seen = at + (pin not in kind.clock_pins)
        values = {name: held[seen] if len(held) > 1 else held for name, held in bits.items()}
        values[pin] = bits[pin][at + 1]
        edges = np.where(values[pin], RISE, FALL)
        allowed = np.array([np.isin(edges, case.edges) for case in known])
        fits = np.array([allowed[n] & (evaluate(c.when, values) if c.when else True) for n, c in enumerate(known)])
        fits = np.where(fits.any(axis=0), fits, allowed)
        shares: NDArray[np.float64] = (fits / np.maximum(fits.sum(axis=0), 1)).mean(axis=1)
        return shares

    def _shares(self, cell: Cell, causes: int, activity: Activity) -> list[float]:
        """Return the share of the output toggles that each related pin causes."""
        if causes == 1:
            return [1.0]
        known = self.library.cells[cell.kind]

        def changes(pin: str) -> NDArray[np.bool_]:
            bits = activity.values.get(cell.pins.get(pin, ""), np.zeros(1, bool))
            return bits[1:] != bits[:-1] if len(bits) > 1 else np.zeros(1, bool)

        after: NDArray[np.bool_] = functools.reduce(np.logical_or, map(changes, known.outputs))
        if not after.any():
            return [1 / causes] * causes
        moved = np.array([np.broadcast_to(changes(pin), after.shape)[after] for pin in related_pins(known)])
        among = moved.sum(axis=0)
        shares = np.where(among, moved / np.maximum(among, 1), 1 / causes).mean(axis=1)
        return [float(share) for share in shares]


def _data_pin(known: Kind) -> str:
    """Return the data pin of a flop or latch, or the enable of a clock gate; empty for other cells."""
    roles = [*(role.data for role in (known.flop, known.latch) if role), *([known.gate.enable] if known.gate else [])]
    return next(iter(roles), "")


def set_up(top: str) -> str:
    """Return the commands that read netlist and library and define ``report``."""
    return programs.filled("power.tcl", top=top, period=PERIOD_NS)


def run(lines: list[str], folder: Path) -> list[Report]:
    """Run an OpenSTA script, and return the power reports of its commands ``report NAME ACTIVITY``."""
    said = programs.opensta("\n".join(lines), {}, folder)
    printed = said.text.splitlines()
    if wrong := [line for line in printed if line.startswith("Error")] or (printed[-1:] if said.status else []):
        raise InputError(f"OpenSTA rejects the netlist: {wrong[0]}; give netlist and cell library of one run")
    files = [folder / f"{line.split()[1]}.txt" for line in lines if line.startswith("report ")]
    rows = [[line.split() for line in file.read_text().splitlines()] for file in files]
    return [{name: (float(own), float(load), float(leakage)) for name, own, load, leakage, _ in one} for one in rows]


class Counted(NamedTuple):
    """Internal energy counted by OpenSTA for a library with 1 pJ per toggle."""

    data_out: float
    clock_in: float
    clock_out: float
    data_in: float


def _counted(folder: Path) -> Counted:
    """Measure how OpenSTA counts internal energy, with test cells of 1 pJ per transition.

    Version 2.0 adds rise and fall up for every toggle; for a data output it halves that where no related pin is named.
    """
    for name, template in (("cells.lib", "probe.lib"), ("netlist.v", "probe.v")):
        (folder / name).write_text(programs.filled(template))
    (found,) = run([set_up("probe"), "report probe 1"], folder)
    picojoules = [round(found[f"c{number}"][0] * PERIOD_S / 1e-12, 3) for number in range(4)]
    assert all(value > 0 for value in picojoules), found
    return Counted(picojoules[0], picojoules[1] / 2, picojoules[2] / 2, picojoules[3])
