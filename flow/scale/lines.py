"""Estimate the row and column lines of an array, with repeaters where they reduce delay."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from eskin.flow.liberty.library import Cell
from eskin.flow.scale.array import NONE, Array, End, repeaters
from eskin.flow.scale.placement import Placement
from eskin.flow.wire import Wire

ROUNDS = 12
"""Passes in which a slew settles along a line of repeaters."""


LEAST_GAIN_S = 100e-12
"""Smallest reduction of delay that justifies a repeater at a driver."""

GRID_F = 10e-15
"""Step of the loads for which delays are cached."""


@dataclass(frozen=True)
class Repeater:
    """Repeater buffer and spacing with the least delay."""

    kind: str
    spacing_um: float
    s_per_mm: float  # delay of the line
    slew_s: float  # slew at the input of a repeater
    load_f: float  # load of a repeater: wire and next repeater


def best_repeater(buffers: Iterable[Cell], wire: Wire) -> Repeater:
    """Return the buffer and spacing with the least delay per length."""
    candidates = []
    for kind in buffers:
        pin = next(iter(kind.loads.values()))
        for spacing in (100.0 * step for step in range(1, 41)):
            slew, load = 50e-12, wire.farad_per_um * spacing + pin
            way = wire.way_s(spacing, pin)
            for _ in range(ROUNDS):
                delay, out = (float(found[0]) for found in kind.worst(slew, np.array([load])))
                slew = degraded(out, way)
            candidates.append(Repeater(kind.name, spacing, 1e3 * (delay + way) / spacing, slew, load))
    return min(candidates, key=lambda repeater: repeater.s_per_mm)


def degraded(slew_s: Any, way_s: Any) -> Any:
    """Return the slew (20 to 80 %) at the end of a wire, with ln 4 times its delay added in quadrature.

    C. V. Kashyap et al., Closed form expressions for extending step delay and slew metrics to ramp inputs, ISPD 2003.
    """
    return (slew_s**2 + (1.386 * way_s) ** 2) ** 0.5


@dataclass
class Open:
    """A wire segment without a driver."""

    ends: list[End] = field(default_factory=list)
    pin_f: float = 0.0
    wire_f: float = 0.0
    way_s: float = 0.0  # Elmore delay to the farthest end

    @property
    def load_f(self) -> float:
        """Total load of the segment on its driver."""
        return self.pin_f + self.wire_f


@dataclass
class Lines:
    """The row and column lines of an array, which gets their repeaters as cells."""

    array: Array
    places: Placement
    wire: Wire
    repeater: Repeater
    # load_f, way_s, length_um: capacitance of the wire, Elmore delay to its farthest end and length, by net
    load_f: dict[int, float] = field(default_factory=dict)
    way_s: dict[int, float] = field(default_factory=dict)
    added: int = 0
    length_um: float = 0.0
    delays: dict[str, list[float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Build all lines except nets that layout buffers as trees."""
        self.choice = repeaters(self.array.kinds)
        drivers, readers = self.array.ends()
        trees = self.array.trees()
        for net, ends in readers.items():
            if net not in trees and net in drivers:
                self._line(net, drivers[net], ends)

    def _line(self, net: int, driver: End, ends: list[End]) -> None:
        """Build one line: a trunk through its driver, and branches to its endpoints."""
        x, y = self.places.of(driver)
        spots = [(*self.places.of(end), end) for end in ends]
        upright = [(ey, ex, end) for ex, ey, end in spots]
        if self._length(y, x, upright) < self._length(x, y, spots):
            part = self._tree(y, x, upright)
        else:
            part = self._tree(x, y, spots)
        wire_f = self.wire.farad_per_um * self.wire.within_um * driver.pins
        part = self._at_driver(part, self.array.driving_cell(driver), driver.load_f + wire_f)
        self._close(part, net)
        self.load_f[net] += wire_f

    def _bin(self, at: float) -> float:
        return round(at / self.places.pitch_um) * self.places.pitch_um

    def _length(self, along: float, across: float, spots: list[tuple[float, float, End]]) -> float:
        """Return the length of a trunk at ``across`` with its branches."""
        branches: dict[float, list[float]] = defaultdict(list)
        for a, b, _ in spots:
            branches[self._bin(b)].append(a)
        marks = [across, *branches]
        return max(marks) - min(marks) + sum(max(*b, along) - min(*b, along) for b in branches.values())

    def _tree(self, along: float, across: float, spots: list[tuple[float, float, End]]) -> Open:
        """Return the load at the driver of a trunk at ``along`` with its branches."""
        branches: dict[float, list[tuple[float, Open]]] = defaultdict(list)
        for a, b, end in spots:
            near = self._bin(b) if len(spots) > 2 else b
            own = self._grown(Open([end], end.load_f), abs(b - near) + self.wire.within_um * end.pins)
            branches[near].append((a, own))
        return self._both_ways(across, [(b, self._both_ways(along, on)) for b, on in branches.items()])

    def _both_ways(self, start: float, items: list[tuple[float, Open]]) -> Open:
        """Return the load at ``start`` of a straight wire with segments on both sides."""
        sides = []
        for side in (-1, 1):
            part = Open()
            chosen = sorted((i for i in items if (i[0] > start) == (side > 0)), key=lambda i: -abs(i[0] - start))
            for number, (at, own) in enumerate(chosen):
                part = self._joined([part, own])
                nearer = chosen[number + 1][0] if number + 1 < len(chosen) else start
                part = self._grown(part, abs(at - nearer))
            sides.append(part)
        return self._joined(sides)

    def _grown(self, part: Open, length: float) -> Open:
        """Return a segment extended by a wire, with repeaters if the wire is long."""
        if not part.ends:
            return part
        self.length_um += length
        per_um = self.wire.farad_per_um
        while per_um and part.load_f + per_um * length > self.repeater.load_f:
            step = max(0.0, min(length, (self.repeater.load_f - part.load_f) / per_um))
            part = self._repeated(self._stretched(part, step))
            length -= step
        return self._stretched(part, length)

    def _stretched(self, part: Open, length: float) -> Open:
        way = part.way_s + self.wire.way_s(length, part.load_f)
        return Open(part.ends, part.pin_f, part.wire_f + self.wire.farad_per_um * length, way)

    def _joined(self, parts: list[Open]) -> Open:
        """Return segments joined at one point, with repeaters if their total load is too high."""
        parts = sorted((p for p in parts if p.ends), key=lambda p: p.load_f)
        while sum(p.load_f for p in parts) > self.repeater.load_f and len(parts) > 1:
            heavy = parts.pop()
            small = self._repeated(heavy)
            if small.load_f >= heavy.load_f:
                parts.append(heavy)
                break
            parts = sorted([*parts, small], key=lambda p: p.load_f)
        return Open(
            [end for p in parts for end in p.ends],
            sum(p.pin_f for p in parts),
            sum(p.wire_f for p in parts),
            max((p.way_s for p in parts), default=0.0),
        )

    def _at_driver(self, part: Open, driver: str, beside_f: float) -> Open:
        """Return a segment with the number of repeaters at its driver that gives the least delay."""
        while True:
            best, chosen = self._delay(driver, beside_f + part.load_f) - LEAST_GAIN_S, ""
            for kind in self.choice:
                pin = next(iter(kind.loads.values()))
                delay = self._delay(driver, beside_f + pin) + self._delay(kind.name, part.load_f)
                if delay < best:
                    best, chosen = delay, kind.name
            if not chosen:
                return part
            part = self._repeated(part, chosen)

    def _delay(self, kind: str, load_f: float) -> float:
        """Return the worst delay of a cell at the slew of the line."""
        if kind not in self.delays:
            cell = self.array.kinds[kind]
            loads = np.asarray([GRID_F * n for n in range(101)], np.float64)
            self.delays[kind] = [*cell.worst(self.repeater.slew_s, loads)[0]] if cell.ways else [0.0] * len(loads)
        known = self.delays[kind]
        at = load_f / GRID_F
        low = min(int(at), len(known) - 2)
        return known[low] + (at - low) * (known[low + 1] - known[low])

    def _repeated(self, part: Open, kind: str = "") -> Open:
        """Return the segment before a repeater that drives a given segment."""
        name = kind or self.repeater.kind
        found = self.array.kinds[name]
        (into, load), out = next(iter(found.loads.items())), found.outputs[0]
        net = self.array.new_net()
        self._close(part, net)
        self.added += 1
        cell = self.array.add(f"repeater_{self.added}", name, {into: NONE, out: net})
        return Open([End("cell", cell, into, load, 1)], load)

    def _close(self, part: Open, net: int) -> None:
        """Connect a segment to the net of a driver."""
        self.load_f[net], self.way_s[net] = part.wire_f, part.way_s
        for end in part.ends:
            self.array.move(end, net)
