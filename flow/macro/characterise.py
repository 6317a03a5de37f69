"""Characterise cells with ngspice: delays, setup and hold times, capacitances and leakage, as a Liberty file."""

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eskin.flow import programs
from eskin.flow.liberty.boolean import evaluate
from eskin.flow.liberty.library import Cell

SUPPLY_V = 1.8
TEMPERATURE_C = 25
SLEWS_NS = (0.02, 0.15, 0.8)
"""Transitions of an input, from 20 % to 80 % of the supply."""
LOADS_PF = (0.001, 0.008, 0.03, 0.08)
CHECK_SLEWS_NS = (0.02, 0.8)
"""Transitions of clock and data for setup and hold times."""

EDGES_NS, END_NS = (1.0, 7.0), 13.0
"""Begin of the two edges of an input, and end of the simulation."""

SEARCH_NS, ROUNDS = (-1.0, 1.0), 8
"""Interval of the search for setup and hold times, and the number of times that the search halves the interval."""
MOST_LATER = 1.1
"""Largest factor by which the delay of a flop may increase before a setup or hold time counts as violated."""

HEAD = """cells
.include "models.spice"
.include "{cells}"
.options gmin=1e-15 abstol=1e-15
.temp {temperature}
Vdd vdd 0 {supply}
"""
MEASURED = re.compile(r"^(\w+) += +(\S+)", re.MULTILINE)
GRID = {
    "slews": SLEWS_NS,
    "loads": LOADS_PF,
    "check": CHECK_SLEWS_NS,
    "supply_v": SUPPLY_V,
    "temperature_c": TEMPERATURE_C,
}
"""Corner and table axes of a Liberty file."""


@dataclass(frozen=True)
class Arc:
    """Measured delays and transitions from an input to an output."""

    start: str
    kind: str  # ``positive_unate``, ``negative_unate`` or ``rising_edge``
    tables: dict[str, np.ndarray]  # in ns, by Liberty name; shape (slews, loads)


@dataclass(frozen=True)
class Measured:
    """Measurements of a cell."""

    arcs: list[Arc]
    capacitances_pf: dict[str, float]  # by input
    leakage_nw: float  # mean over all states
    limits: dict[str, dict[str, np.ndarray]]  # setup and hold times of a flop in ns, by edge; shape (2, 2)


def trimmed(models: str, cells: str) -> str:
    """Return the SPICE models that the cells use; ngspice would need seconds for all 600 models."""
    used = {(name, float(length)) for name, length in re.findall(r" (\S+) l=(\S+)", cells)}
    kept = []
    for block in re.split(r"^(?=\.model )", models, flags=re.MULTILINE):
        found = re.match(r"\.model (\S+)\.\d+ .*?lmin = (\S+) lmax = (\S+)", block, re.DOTALL)
        if found and any(name == found[1] and float(found[2]) <= length < float(found[3]) for name, length in used):
            kept.append(block)
    return "".join(kept)


def simulate(deck: str, folder: Path) -> dict[str, float]:
    """Return the measurements of an ngspice deck by name, without failed measurements."""
    (folder / "deck.sp").write_text(deck + f".tran 10p {END_NS}n 0 100p\n.end\n")
    done = programs.call(folder, "ngspice", "-b", "deck.sp")
    found = {name: float(value) for name, value in MEASURED.findall(done.stdout) if value != "failed"}
    if not found:
        raise RuntimeError(f"ngspice measured nothing: {(done.stderr or done.stdout).strip()[-300:]}")
    return found


def wave(name: str, edges: Sequence[tuple[float, float]], slew_ns: float) -> str:
    """Return a voltage source of a node.

    ``edges``: middle of each edge in ns, and level after it as a share of the supply; the first entry is the start.
    """
    half = slew_ns / 0.6 / 2
    level = edges[0][1] * SUPPLY_V
    points = [f"0 {level}"]
    for time, share in edges[1:]:
        points += [f"{time - half:.5f}n {level}", f"{time + half:.5f}n {share * SUPPLY_V}"]
        level = share * SUPPLY_V
    return f"V{name} {name} 0 pwl({' '.join(points)})\n"


def delay(name: str, start: str, end: str, after_ns: float) -> str:
    """Return the measurement of a delay between the middles of two edges."""
    half = SUPPLY_V / 2
    after = f"td={after_ns}n"
    return f".measure tran {name} trig v({start}) val={half} {after} cross=1 targ v({end}) val={half} {after} cross=1\n"


def transition(name: str, node: str, rising: bool, after_ns: float) -> str:
    """Return the measurement of a transition from 20 % to 80 %."""
    low, high = 0.2 * SUPPLY_V, 0.8 * SUPPLY_V
    first, last, edge = (low, high, "rise") if rising else (high, low, "fall")
    after = f"td={after_ns}n {edge}=1"
    return f".measure tran {name} trig v({node}) val={first:g} {after} targ v({node}) val={last:g} {after}\n"


def conditions(cell: Cell, pin: str, output: str) -> Iterator[tuple[dict[str, bool], bool]]:
    """Yield the levels of the other inputs at which an output follows an input, and whether the output is inverted."""
    others = [name for name in cell.inputs if name != pin]
    for levels in itertools.product((False, True), repeat=len(others)):
        side = dict(zip(others, levels, strict=True))
        values = {name: np.array(level) for name, level in side.items()} | {pin: np.array([False, True])}
        low, high = np.broadcast_to(evaluate(cell.functions[output], values), 2)
        if low != high:
            yield side, bool(low)


class Characteriser:
    """Simulations of the cells of a SPICE file (supplies ``vdd`` and ``vss``) with models of their transistors."""

    def __init__(self, spice: Path, models: Path, folder: Path) -> None:
        self.folder = folder
        text = spice.read_text()
        (folder / "models.spice").write_text(trimmed(models.read_text(), text))
        self.head = HEAD.format(cells=spice.resolve(), temperature=TEMPERATURE_C, supply=SUPPLY_V)
        lines = re.findall(r"^\.subckt (\S+) (.*)$", text, re.MULTILINE)
        self.ports = {name: ports.split() for name, ports in lines}

    def instance(self, number: int | str, cell: Cell, nodes: Mapping[str, str], supply: str = "vdd") -> str:
        """Return an instance of a cell; pins without a node are open."""
        wires = {"vdd": supply, "vss": "0"} | dict(nodes)
        return f"X{number} {' '.join(wires.get(p, f'{p}_{number}') for p in self.ports[cell.name])} {cell.name}\n"

    def library(self, cells: Sequence[Cell]) -> str:
        """Return cells with measured times, capacitances and leakage as Liberty text."""
        measured = [(cell, self._flop(cell) if cell.flop else self._gate(cell)) for cell in cells]
        return programs.filled("measured.lib", cells=measured, grid=GRID)

    def _gate(self, cell: Cell) -> Measured:
        """Return the measurements of a gate."""
        (output,), deck, numbers = cell.outputs, [self.head], itertools.count()
        first, second = EDGES_NS
        for index, slew in enumerate(SLEWS_NS):
            deck.append(wave(f"p{index}", [(0, 0), (first, 1), (second, 0)], slew))
        asked: list[tuple[str, bool, int, int, int]] = []
        for pin in cell.inputs:
            for (side, inverted), (i, _), (j, load) in itertools.product(
                conditions(cell, pin, output), enumerate(SLEWS_NS), enumerate(LOADS_PF)
            ):
                n = next(numbers)
                out = f"o{n}"
                nodes = {name: "vdd" if level else "0" for name, level in side.items()} | {pin: f"p{i}", output: out}
                deck += [self.instance(n, cell, nodes), f"C{n} {out} 0 {load}p\n"]
                for rising in (False, True):
                    edge, after = "r" if rising else "f", 0.0 if rising != inverted else second - 2
                    deck.append(delay(f"d{edge}{n}", f"p{i}", out, after))
                    deck.append(transition(f"t{edge}{n}", out, rising, after))
                asked.append((pin, inverted, n, i, j))
        deck += self._loads(cell, [(pin, *next(conditions(cell, pin, output))) for pin in cell.inputs])
        for levels in itertools.product("01", repeat=len(cell.inputs)):
            state = {name: "vdd" if level == "1" else "0" for name, level in zip(cell.inputs, levels, strict=True)}
            deck.append(self._leak(next(numbers), cell, state))
        found = simulate("".join(deck), self.folder)
        arcs = []
        for (pin, inverted), group in itertools.groupby(sorted(asked), key=lambda one: one[:2]):
            tables = _tables(found, [(f"{n}", i, j) for _, _, n, i, j in group])
            arcs.append(Arc(pin, "negative_unate" if inverted else "positive_unate", tables))
        return Measured(arcs, *self._rest(cell, found), {})

    def _leak(self, number: int, cell: Cell, nodes: Mapping[str, str]) -> str:
        """Return deck lines that measure the supply current of a cell at rest."""
        own = f"s{number}"
        parts = f"V{own} {own} 0 {SUPPLY_V}\n", self.instance(number, cell, nodes, own)
        return "".join((*parts, f".measure tran l{number} avg i(v{own}) from={END_NS - 3}n to={END_NS}n\n"))

    def _loads(self, cell: Cell, sides: Sequence[tuple[str, Mapping[str, bool], bool]]) -> list[str]:
        """Return deck lines that measure the charge of each input over a rising edge."""
        deck, slew = [], SLEWS_NS[len(SLEWS_NS) // 2]
        for pin, side, _ in sides:
            nodes = {name: "vdd" if level else "0" for name, level in side.items()} | {pin: f"c_{pin}"}
            deck += [wave(f"c_{pin}", [(0, 0), (EDGES_NS[0], 1)], slew), self.instance(f"c_{pin}", cell, nodes)]
            deck.append(f".measure tran q_{pin} integ i(vc_{pin}) from=0.5n to=5n\n")
        return deck

    def _rest(self, cell: Cell, found: Mapping[str, float]) -> tuple[dict[str, float], float]:
        """Return input capacitances in pF and mean leakage in nW, from measurements."""
        leaks = [-value for name, value in found.items() if re.fullmatch(r"l\d+", name)]
        capacitances = {pin: -1e12 * found[f"q_{pin}"] / SUPPLY_V for pin in cell.inputs}
        return capacitances, 1e9 * SUPPLY_V * float(np.mean(leaks))

    def _flop(self, cell: Cell) -> Measured:
        """Return the measurements of a flip-flop of the rising edge."""
        (clock,), (data,) = cell.clock_pins, [name for name in cell.inputs if name not in cell.clock_pins]
        (output,), deck, n = cell.outputs, [self.head], 0
        first, second = EDGES_NS
        middle = (first + second) / 2
        for index, slew in enumerate(SLEWS_NS):
            deck.append(wave(f"k{index}", [(0, 0), (first, 1), (middle, 0), (second, 1)], slew))
        for value in (0, 1):
            deck.append(wave(f"d{value}", [(0, 1 - value), (middle, value)], SLEWS_NS[0]))
            for (i, _), (j, load) in itertools.product(enumerate(SLEWS_NS), enumerate(LOADS_PF)):
                edge, name = "fr"[value], f"{i}_{j}"
                out = f"o{value}_{name}"
                deck.append(self.instance(f"{value}_{name}", cell, {clock: f"k{i}", data: f"d{value}", output: out}))
                deck += [f"C{out} {out} 0 {load}p\n", delay(f"d{edge}{name}", f"k{i}", out, middle + 1)]
                deck.append(transition(f"t{edge}{name}", out, bool(value), middle + 1))
            for level in (0, 1):  # after a clock edge, with the clock low and high
                deck.append(wave(f"r{n}", [(0, 0), (1, 1), (3, 0), (5, level)], SLEWS_NS[0]))
                deck.append(self._leak(n, cell, {clock: f"r{n}", data: "vdd" if value else "0"}))
                n += 1
        deck += self._loads(cell, [(clock, {data: False}, False), (data, {clock: False}, False)])
        found = simulate("".join(deck), self.folder)
        points = itertools.product(range(len(SLEWS_NS)), range(len(LOADS_PF)))
        tables = _tables(found, [(f"{i}_{j}", i, j) for i, j in points])
        return Measured([Arc(clock, "rising_edge", tables)], *self._rest(cell, found), self._limits(cell, tables))

    def _limits(self, cell: Cell, usual: Mapping[str, np.ndarray]) -> dict[str, dict[str, np.ndarray]]:
        """Return setup and hold times of a flip-flop by edge, found by halving an interval."""
        (clock,), (data,), (output,) = (
            cell.clock_pins,
            [n for n in cell.inputs if n not in cell.clock_pins],
            cell.outputs,
        )
        middle = sum(EDGES_NS) / 2
        points = list(itertools.product(("setup", "hold"), (0, 1), CHECK_SLEWS_NS, CHECK_SLEWS_NS))
        delays = {value: usual[name] for value, name in ((0, "cell_fall"), (1, "cell_rise"))}
        low, high = np.full(len(points), SEARCH_NS[0]), np.full(len(points), SEARCH_NS[1])
        for _ in range(ROUNDS):
            tried = (low + high) / 2
            deck = [self.head]
            for n, ((kind, value, clock_slew, data_slew), gap) in enumerate(zip(points, tried, strict=True)):
                # The flop stores the other value first. Setup: the new value comes late. Hold: it goes early.
                moves = [(middle, value), (EDGES_NS[1] + gap, 1 - value)]
                moves = moves if kind == "hold" else [(EDGES_NS[1] - gap, value)]
                deck.append(wave(f"k{n}", [(0, 0), (EDGES_NS[0], 1), (middle, 0), (EDGES_NS[1], 1)], clock_slew))
                deck.append(wave(f"d{n}", [(0, 1 - value), *moves], data_slew))
                deck.append(self.instance(n, cell, {clock: f"k{n}", data: f"d{n}", output: f"o{n}"}))
                deck += [f"C{n} o{n} 0 {LOADS_PF[1]}p\n", delay(f"d{n}", f"k{n}", f"o{n}", middle + 1)]
                deck.append(f".measure tran v{n} find v(o{n}) at={END_NS - 1}n\n")
            found = simulate("".join(deck), self.folder)
            for n, (_, value, clock_slew, _) in enumerate(points):
                most_s = MOST_LATER * 1e-9 * delays[value][SLEWS_NS.index(clock_slew), 1]
                stored = abs(found[f"v{n}"] - value * SUPPLY_V) < SUPPLY_V / 4
                kept = stored and found.get(f"d{n}", np.inf) <= most_s
                (high if kept else low)[n] = tried[n]
        limits: dict[str, dict[str, np.ndarray]] = {"setup": {}, "hold": {}}
        for kind, value, name in (("setup", 1, "rise"), ("setup", 0, "fall"), ("hold", 0, "rise"), ("hold", 1, "fall")):
            # Hold: the edge away from a stored 0 rises.
            rows = [high[n] for n, point in enumerate(points) if point[:2] == (kind, value)]
            limits[kind][name] = np.reshape(rows, (2, 2))
        return limits


def _tables(found: Mapping[str, float], points: Sequence[tuple[str, int, int]]) -> dict[str, np.ndarray]:
    """Return the largest delays and transitions in ns of the instances at each point of slew and load."""
    tables = {}
    for name, what in (("cell_rise", "dr"), ("cell_fall", "df"), ("rise_transition", "tr"), ("fall_transition", "tf")):
        tables[name] = np.full((len(SLEWS_NS), len(LOADS_PF)), -np.inf)
        for instance, i, j in points:
            tables[name][i, j] = max(tables[name][i, j], 1e9 * found[f"{what}{instance}"])
    return tables
