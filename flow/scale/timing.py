"""Static timing analysis of an array, vectorised over cells: shortest period and critical path."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from eskin.flow.liberty.library import Cell
from eskin.flow.liberty.tables import Arc, Floats
from eskin.flow.scale.array import NONE, Array
from eskin.flow.scale.lines import Lines, degraded
from eskin.rtl.delivery import OUTSIDE, UNCERTAINTY

Ints = NDArray[np.int64]
FROM_FLOP, FROM_PORT = 0, 1
NEVER = -1e9


class Stage(NamedTuple):
    """A stage of a path: instance, cell kind, arrival time at the output, and delay of the wire before the cell."""

    name: str
    kind: str
    arrival_s: float
    wire_s: float


@dataclass(frozen=True)
class Path:
    """The critical path, which limits the clock period."""

    period_s: float
    stages: tuple[Stage, ...]
    # start, end: flop or port
    start: str
    end: str


@dataclass
class Group:
    """All cells of a kind with the nets of every pin."""

    kind: Cell
    cells: Ints
    pins: dict[str, Ints]


class Timing:
    """Arrival times and slews of all nets."""

    def __init__(self, array: Array, lines: Lines) -> None:
        self.array = array
        outside = {bit for port in array.taxel["ports"].values() for bit in port["bits"]}
        wired = [bits for cell in array.taxel["cells"].values() for bits in cell["connections"].values()]
        self.inner = sorted({bit for bits in wired for bit in bits if isinstance(bit, int)} - outside)
        self.nets = array.nets + len(self.inner) * len(array.taxels)
        self.groups = self._groups()
        self.load, self.wire = self._loads(lines)
        self.arrival = np.full((2, 2, self.nets), NEVER)  # where the path starts, edge, net
        self.slew = np.zeros((2, self.nets))
        self._run()

    def _groups(self) -> dict[str, Group]:
        """Return the cells grouped by kind, taxel cells last."""
        array = self.array
        by_kind: dict[str, list[int]] = {}
        for number, kind in enumerate(array.cells):
            by_kind.setdefault(kind, []).append(number)
        found: dict[str, list[tuple[Ints, dict[str, Ints]]]] = {}
        for kind, own in by_kind.items():
            pins = {pin: np.array([array.pins[n].get(pin, NONE) for n in own]) for pin in _pins(array.kinds[kind])}
            found[kind] = [(np.array(own), pins)]
        where = self._taxel_nets()
        for number, cell in enumerate(array.taxel["cells"].values()):
            kind = cell["type"]
            cells = len(array.cells) + number + len(array.taxel["cells"]) * np.arange(len(array.taxels))
            bits = {pin: cell["connections"].get(pin, [NONE]) or [NONE] for pin in _pins(array.kinds[kind])}
            none = np.full(len(array.taxels), NONE)
            found.setdefault(kind, []).append((cells, {p: where.get(b[0], none) for p, b in bits.items()}))
        return {
            kind: Group(
                array.kinds[kind],
                np.concatenate([cells for cells, _ in parts]),
                {pin: np.concatenate([pins[pin] for _, pins in parts]) for pin in _pins(array.kinds[kind])},
            )
            for kind, parts in found.items()
        }

    def _taxel_nets(self) -> dict[int | str, Ints]:
        """Return the nets of a taxel module for every taxel."""
        count, array = len(self.array.taxels), self.array
        where: dict[int | str, Ints] = {
            bit: array.nets + i + len(self.inner) * np.arange(count) for i, bit in enumerate(self.inner)
        }
        for name, (_, bit) in array.taxel_bits.items():
            where[bit] = np.array([taxel.get(name, NONE) for taxel in array.taxels])
        return where

    def _loads(self, lines: Lines) -> tuple[Floats, Floats]:
        """Return load and wire delay of every net."""
        load, wire = np.zeros(self.nets), np.zeros(self.nets)
        pins = np.zeros(self.nets)
        for group in self.groups.values():
            for pin, nets in group.pins.items():
                on = nets[nets >= 0]
                np.add.at(load, on, group.kind.loads.get(pin, 0.0))
                np.add.at(pins, on, 1.0)
        load[self.array.nets :] += (lines.wire.farad_per_um * lines.wire.within_um * pins)[self.array.nets :]
        for net, extra in lines.load_f.items():
            load[net] += extra
            wire[net] = lines.way_s[net]
        for way, _, _, net in self.array.ports:
            if way == "output" and net >= 0:
                load[net] += self.array.port_load_f
        return load, wire

    def _run(self) -> None:
        """Compute all arrival times, level by level."""
        for group in self.groups.values():
            if group.kind.launch:
                self._launch(group)
        self._ports()
        follows = self._pins_of(lambda kind: kind.outputs) @ self._pins_of(lambda kind: kind.loads).T  # cells x cells
        waits = np.asarray(follows.sum(axis=0)).ravel()
        kind_of, place_of = self._where()
        groups = list(self.groups.values())
        now = np.flatnonzero((waits == 0) & (kind_of >= 0))
        while len(now):
            for number in np.unique(kind_of[now]):
                self._pass(groups[number], place_of[now[kind_of[now] == number]])
            ended = np.asarray(follows[now].sum(axis=0)).ravel()
            waits -= ended
            now = np.flatnonzero((ended > 0) & (waits == 0))

    def _pins_of(self, choose: Callable[[Cell], Iterable[str]]) -> csr_matrix:
        """Return the number of chosen pins of each combinational cell at each net, shape (cells, nets)."""
        pins = [(g, pin) for g in self.groups.values() if not g.kind.launch for pin in choose(g.kind)]
        cells = np.concatenate([group.cells for group, _ in pins])
        nets = np.concatenate([group.pins[pin] for group, pin in pins])
        on = nets >= 0
        return csr_matrix((np.ones(on.sum(), np.int64), (cells[on], nets[on])), (self._cells, self.nets))

    @property
    def _cells(self) -> int:
        return len(self.array.cells) + len(self.array.taxel["cells"]) * len(self.array.taxels)

    def _launch(self, group: Group) -> None:
        """Launch signals from the flops of a kind, with a steep clock edge."""
        for arc in group.kind.ways:
            nets = group.pins[arc.end]
            on = nets >= 0
            self._send(arc, nets[on], np.zeros((2, on.sum())), np.zeros((2, 2, on.sum())), [FROM_FLOP])

    def _send(self, arc: Arc, nets: Ints, slew: Floats, arrival: Floats, starts: list[int]) -> None:
        """Propagate a timing arc to its output nets."""
        for into, out in arc.edges:
            delay = arc.delay[out].at(slew[into], self.load[nets])
            late = arc.slew[out].at(slew[into], self.load[nets])
            for start in starts:
                came = arrival[start, into] + delay
                np.maximum.at(self.arrival[start, out], nets, came)
            np.maximum.at(self.slew[out], nets, np.maximum(late, 0.0))

    def _ports(self) -> None:
        """Launch signals from the input ports."""
        kind = self.array.kinds[self.array.port_buffer]
        trees = self.array.trees()
        nets = np.array([n for way, _, _, n in self.array.ports if way == "input" and n >= 0 and n not in trees])
        for arc in kind.ways:
            for _, out in arc.edges:
                none = np.zeros(len(nets))
                delay = arc.delay[out].at(none, self.load[nets]) - arc.delay[out].at(none, none)
                np.maximum.at(self.arrival[FROM_PORT, out], nets, delay)
                np.maximum.at(self.slew[out], nets, arc.slew[out].at(none, self.load[nets]))

    def _at_pins(self, nets: Ints) -> tuple[Floats, Floats]:
        """Return slews (edge, pin) and arrival times (start, edge, pin) at input pins."""
        on = np.maximum(nets, 0)
        wire = self.wire[on]
        slew = degraded(self.slew[:, on], wire)
        arrival = self.arrival[:, :, on] + wire
        arrival[:, :, nets < 0] = NEVER
        return slew, arrival

    def _pass(self, group: Group, at: Ints) -> None:
        """Propagate through cells of a kind whose input arrivals are known."""
        for arc in group.kind.ways:
            nets = group.pins[arc.end][at]
            on = nets >= 0
            slew, arrival = self._at_pins(group.pins[arc.start][at][on])
            self._send(arc, nets[on], slew, arrival, [FROM_FLOP, FROM_PORT])

    def _where(self) -> tuple[Ints, Ints]:
        """Return kind and index of each cell; -1 for flops."""
        kind_of, place_of = np.full(self._cells, -1), np.zeros(self._cells, np.int64)
        for number, group in enumerate(self.groups.values()):
            place_of[group.cells] = np.arange(len(group.cells))
            if not group.kind.launch:
                kind_of[group.cells] = number
        return kind_of, place_of

    def worst(self, ports: bool = True) -> Path:
        """Return the critical path of all paths, or of the paths between flops."""
        best: tuple[float, int, int, int, str] = (0.0, NONE, 0, 0, "")
        for group in self.groups.values():
            for pin, tables in group.kind.setup.items():
                nets = group.pins[pin]
                slew, arrival = self._at_pins(nets)
                for edge, table in tables.items():
                    needs = table.at(slew[edge], np.zeros(len(nets)))
                    for start, share in ((FROM_FLOP, 0.0), (FROM_PORT, OUTSIDE))[: 1 + ports]:
                        period = (arrival[start, edge] + needs) / (1 - UNCERTAINTY - share)
                        at = int(np.argmax(period))
                        best = max(best, (period[at], int(nets[at]), edge, start, self.name(int(group.cells[at]))))
        for way, name, bit, net in self.array.ports if ports else ():
            for edge in (0, 1) if way == "output" and net >= 0 else ():
                for start, share in ((FROM_FLOP, OUTSIDE), (FROM_PORT, 2 * OUTSIDE)):
                    arrived = self.arrival[start, edge, net] + self.wire[net]
                    best = max(best, (arrived / (1 - UNCERTAINTY - share), net, edge, start, f"{name}[{bit}]"))
        period, net, edge, start, end = best
        return Path(float(period), *self._trace(net, edge, start), end)

    def _trace(self, net: int, edge: int, start: int) -> tuple[tuple[Stage, ...], str]:
        """Return the stages before an edge of a net, and their start."""
        drivers = self._drivers()
        stages: list[Stage] = []
        while net in drivers:
            group, at = drivers[net]
            name, arrival = self.name(int(group.cells[at])), float(self.arrival[start, edge, net])
            found = None
            for arc in () if group.kind.launch else group.kind.ways:
                for into, out in arc.edges:
                    before = int(group.pins[arc.start][at])
                    if out != edge or group.pins[arc.end][at] != net or before < 0:
                        continue
                    slew, came = self._at_pins(np.array([before]))
                    sent = float(came[start, into, 0] + arc.delay[out].at(slew[into], self.load[[net]])[0])
                    if found is None or sent > found[0]:
                        found = sent, before, into
            wire = float(self.wire[found[1]]) if found else 0.0
            stages.append(Stage(name, group.kind.name, arrival, wire))
            if found is None:
                return tuple(reversed(stages)), name
            _, net, edge = found
        port = next((f"{n}[{b}]" for _, n, b, at_net in self.array.ports if at_net == net), "")
        return tuple(reversed(stages)), port

    def _drivers(self) -> dict[int, tuple[Group, int]]:
        return {
            int(net): (group, at)
            for group in self.groups.values()
            for pin in group.kind.outputs
            for at, net in enumerate(group.pins[pin])
            if net >= 0
        }

    def name(self, cell: int) -> str:
        """Return the instance name of a cell."""
        if cell < len(self.array.cells):
            return self.array.names[cell]
        taxel, number = divmod(cell - len(self.array.cells), len(self.array.taxel["cells"]))
        row, column = divmod(taxel, self.array.config.columns)
        return f"row_{row}.taxel_{column}.{list(self.array.taxel['cells'])[number]}"


def _pins(kind: Cell) -> list[str]:
    return [*kind.loads, *kind.outputs]
