"""A cell library: cells with pins, memories, clock gates, areas, loads and leakage."""

import functools
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from eskin.base.errors import InputError
from eskin.flow.liberty.boolean import literal
from eskin.flow.liberty.entry import Entry, parse
from eskin.flow.liberty.tables import EDGES, Arc, Energy, Floats, Scales, Table, read_table

DIRECTIONS = ("input", "output", "inout", "internal")
PREFIXES = {"": 1.0, "f": 1e-15, "p": 1e-12, "n": 1e-9, "u": 1e-6, "m": 1e-3, "k": 1e3}


@dataclass(frozen=True)
class Pin:
    """A pin of a cell."""

    name: str
    direction: str
    # function, three_state: Liberty expressions of the value of an output, and of the condition to float
    function: str
    three_state: str
    # capacitance_f, load_f: capacitance of an input, and the larger capacitance of its two edges
    capacitance_f: float
    load_f: float
    clock: bool
    role: str  # role in an integrated clock gate: ``clock``, ``enable``, ``out`` or ``test``
    entry: Entry = field(repr=False)
    scales: Scales = field(repr=False)

    @functools.cached_property
    def energies(self) -> list[Energy]:
        """Internal energies for transitions of this pin."""
        return [
            Energy(
                frozenset(group.text("related_pin").split()),
                group.text("when"),
                self._by_edge(group, "{}_power", self.scales.energy)
                or self._by_edge(group, "power", self.scales.energy),
            )
            for group in self.entry.all("internal_power")
        ]

    @functools.cached_property
    def arcs(self) -> list[Arc]:
        """Timing arcs to this pin that have a delay or a transition time."""
        found = []
        for group in self.entry.all("timing"):
            tables = [self._by_edge(group, kind, self.scales.time) for kind in ("cell_{}", "{}_transition")]
            if any(tables):
                kind, sense = group.text("timing_type"), group.text("timing_sense")
                found += [Arc(start, self.name, kind, sense, *tables) for start in group.text("related_pin").split()]
        return found

    def _by_edge(self, group: Entry, name: str, unit: float) -> dict[int, Table]:
        """Return the tables of a group for rising and falling edges."""
        found = {edge: group.all(name.format(word)) for edge, word in EDGES.items()}
        return {edge: read_table(tables[0], self.scales, unit) for edge, tables in found.items() if tables}


@dataclass(frozen=True)
class Memory:
    """State of a flip-flop or latch, as Liberty expressions."""

    is_flop: bool
    # state, inverse: names of the bit and of its inverse
    state: str
    inverse: str
    # when, stored: clock or enable, and the value that is stored then
    when: str
    stored: str
    # clear, preset: conditions that reset the bit to 0 and to 1; empty without such a reset
    clear: str
    preset: str
    both: str  # level while both are active, ``H`` or ``L`` for instance
    outputs: dict[str, bool]  # output pins; True where inverted

    @property
    def clock(self) -> str:
        """Clock pin of a flop, or enable pin of a latch."""
        return literal(self.when).strip("!'")

    @property
    def rising(self) -> bool:
        """True for a flop that stores data at the rising edge, or a latch that is open while its enable is high."""
        return not {"!", "'"} & set(self.when)

    @property
    def data(self) -> str:
        """Data pin, if the next state is a single pin."""
        return literal(self.stored)


@dataclass(frozen=True)
class ClockGate:
    """Pins of an integrated clock gate: clock, enable, gated clock and optional test enable."""

    clock: str
    enable: str
    gated: str
    test: str


@dataclass(frozen=True)
class Cell:
    """A cell of a library with its pins and functions."""

    name: str
    area_um2: float
    leakage_w: float  # leakage in any state
    leakage_states: list[tuple[str, float]]  # conditions, and the leakage under each in watts
    pins: dict[str, Pin] = field(repr=False)
    memory: Memory | None  # of a flip-flop or latch, or of a clock gate that has such a group
    gate_kind: str  # of an integrated clock gate, ``latch_posedge``; empty for other cells
    dont_use: bool
    entry: Entry = field(repr=False)

    @functools.cached_property
    def inputs(self) -> list[str]:
        """Names of the input pins."""
        return [name for name, pin in self.pins.items() if pin.direction == "input"]

    @functools.cached_property
    def loads(self) -> dict[str, float]:
        """Capacitance of every input pin in farad."""
        return {name: self.pins[name].load_f for name in self.inputs}

    @functools.cached_property
    def outputs(self) -> list[str]:
        """Names of the output pins."""
        return [name for name, pin in self.pins.items() if pin.direction == "output"]

    @functools.cached_property
    def functions(self) -> dict[str, str]:
        """Boolean functions of the output pins by name, in Liberty syntax, without pins that have no function."""
        return {name: pin.function for name, pin in self.pins.items() if pin.direction != "input" and pin.function}

    @functools.cached_property
    def clock_pins(self) -> list[str]:
        """Clock inputs of a flop, latch or clock gate."""
        return [name for name in self.inputs if self.pins[name].clock]

    @property
    def flop(self) -> Memory | None:
        """State of a flip-flop; None for other cells."""
        return self.memory if self.memory and self.memory.is_flop else None

    @property
    def latch(self) -> Memory | None:
        """State of a latch; None for other cells and for clock gates."""
        return self.memory if self.memory and not (self.memory.is_flop or self.gate_kind) else None

    @functools.cached_property
    def gate(self) -> ClockGate | None:
        """Pins of a rising-edge integrated clock gate, or None."""
        roles = {pin.role: name for name, pin in self.pins.items() if pin.role}
        whole = self.gate_kind.startswith("latch_posedge") and "obs" not in self.gate_kind
        if not whole or not {"clock", "enable", "out"} <= set(roles):
            return None
        return ClockGate(roles["clock"], roles["enable"], roles["out"], roles.get("test", ""))

    @property
    def launch(self) -> str:
        """Clock pin of a flop or clock gate; empty for other cells."""
        return next(iter(self.clock_pins), "") if self.flop or self.gate_kind else ""

    @functools.cached_property
    def ways(self) -> list[Arc]:
        """Timing arcs with a delay, except arcs from resets."""
        kinds = ("", "combinational", "rising_edge")
        arcs = [arc for name in self.outputs for arc in self.pins[name].arcs if arc.delay and arc.kind in kinds]
        for arc in arcs:
            if not set(arc.delay) <= set(arc.slew):
                raise self.pins[arc.end].entry.wrong("timing", f"has a delay from {arc.start} without a transition")
        return [arc for arc in arcs if not self.launch or arc.start == self.launch]

    def worst(self, slew_s: float, loads_f: Floats) -> tuple[Floats, Floats]:
        """Return the longest delay and slew of all timing arcs, for loads of shape (n,)."""
        slews = np.full(len(loads_f), slew_s)
        found = [
            (arc.delay[e].at(slews, loads_f), arc.slew[e].at(slews, loads_f)) for arc in self.ways for _, e in arc.edges
        ]
        delays, late = zip(*found, strict=True)
        return np.max(delays, axis=0), np.max(late, axis=0)

    def check(self) -> None:
        """Raise InputError if a table of the cell is invalid."""
        for pin in self.pins.values():
            _ = pin.energies, pin.arcs
        _ = self.ways

    def drives(self, function: str) -> str:
        """Return the output pin of a single-output cell with a given function, or an empty text."""
        found = [pin for pin, text in self.functions.items() if literal(text) == function]
        return found[0] if found and len(self.functions) == 1 else ""


@dataclass(frozen=True)
class Library:
    """A cell library at one corner."""

    path: Path
    name: str
    process: float
    voltage_v: float
    temperature_c: float
    cells: dict[str, Cell] = field(repr=False)
    scales: Scales = field(repr=False)
    entry: Entry = field(repr=False)

    @functools.cached_property
    def content(self) -> bytes:
        """Content of the Liberty file as bytes."""
        return self.path.read_bytes()

    @functools.cached_property
    def flops(self) -> frozenset[str]:
        """Names of the flip-flops."""
        return frozenset(name for name, cell in self.cells.items() if cell.flop)

    @property
    def clock_gate(self) -> Cell | None:
        """Smallest rising-edge integrated clock gate, preferably with test enable."""
        gates = [cell for cell in self.cells.values() if cell.gate]
        return min(gates, key=lambda cell: (not (cell.gate and cell.gate.test), cell.area_um2), default=None)

    @property
    def gate_latch(self) -> Cell | None:
        """Smallest latch without clear and preset for building a clock gate, preferably open at low enable."""
        simple = [c for c in self.cells.values() if c.latch and not (c.latch.clear or c.latch.preset)]
        return min(simple, key=lambda cell: (cell.latch.rising if cell.latch else True, cell.area_um2), default=None)

    def tie(self, level: int) -> tuple[str, str] | None:
        """Return cell and pin that give a constant 0 or 1, or None."""
        found = [(c.area_um2, c.name, pin) for c in self.cells.values() if (pin := c.drives(str(level)))]
        return min(found)[1:] if found else None

    @property
    def buffers(self) -> list[Cell]:
        """Buffers from smallest to largest."""
        found = [c for c in self.cells.values() if len(c.inputs) == 1 and not c.dont_use and c.drives(c.inputs[0])]
        return sorted(found, key=lambda cell: cell.area_um2)

    def check(self) -> None:
        """Raise InputError if a table of any cell is invalid."""
        for cell in self.cells.values():
            cell.check()

    def used(self, kinds: set[str]) -> Iterator[Cell]:
        """Yield the cells with given names, in order."""
        for kind in sorted(kinds):
            if kind not in self.cells:
                raise InputError(f"the cell library {self.path} has no cell {kind}; give the library of the netlist")
            yield self.cells[kind]


def read(path: Path) -> Library:
    """Return the library from a Liberty file, cached within the process."""
    try:
        state = path.stat()
    except OSError as error:
        raise InputError(f"cannot read the cell library {path}: {error.strerror}") from None
    return _read(path, state.st_mtime_ns, state.st_size)


@functools.lru_cache(maxsize=8)
def _read(path: Path, *_: int) -> Library:
    entry = parse(path)
    scales = _scales(entry)
    cells = {name: _cell(name, cell, scales) for name, cell in entry.named("cell").items()}
    process, voltage, temperature_c = _corner(entry)
    name = entry.names(1)[0] if entry.group.args else path.stem
    library = Library(path, name, process, voltage * scales.voltage, temperature_c, cells, scales, entry)
    if not library.flops:
        raise InputError(f"the cell library {path} has no flip-flop: no cell of it has an ff group; give another .lib")
    if not any(len(cell.inputs) > 1 and cell.functions and not (cell.flop or cell.latch) for cell in cells.values()):
        raise InputError(f"the cell library {path} has no logic gate: no cell of it has a function; give another .lib")
    return library


def _corner(library: Entry) -> tuple[float, float, float]:
    """Return process, voltage and temperature of a library."""
    conditions = library.named("operating_conditions")
    default = library.text("default_operating_conditions")
    chosen = conditions.get(default) or next(iter(conditions.values()), library)
    found = []
    for name, least in (("process", 0.0), ("voltage", 1e-3), ("temperature", -273.15)):
        value = library.number(f"nom_{name}", chosen.number(name, 1.0 if name == "process" else math.nan, least), least)
        if math.isnan(value):
            raise InputError(
                f"the cell library {library.path} has no corner: nom_{name} and operating_conditions are "
                f"missing; give another .lib"
            )
        found.append(value)
    return found[0], found[1], found[2]


def _scales(library: Entry) -> Scales:
    """Return the units of a library."""
    load = library.value("capacitive_load_unit")
    words = [str(word).strip('"').strip() for word in (load if isinstance(load, list) else ["1", load or "pf"])]
    text = "".join(words) if len(words) == 2 else f"({', '.join(words)})"
    capacitance = _unit(library, "capacitive_load_unit", text, "f")
    return Scales(
        _unit(library, "time_unit", library.text("time_unit") or "1ns", "s"),
        capacitance,
        _unit(library, "leakage_power_unit", library.text("leakage_power_unit") or "1nW", "W"),
        _unit(library, "voltage_unit", library.text("voltage_unit") or "1V", "V"),
        library.number("default_input_pin_cap", least=0.0) * capacitance,
        library.named("lu_table_template") | library.named("power_lut_template"),
    )


def _unit(library: Entry, name: str, text: str, base: str) -> float:
    """Return the factor of a unit such as ``10ps``."""
    found = re.fullmatch(rf"(\d+\.?\d*|)\s*([fpnumk]?){base}", text, re.IGNORECASE)
    value = float(found[1] or 1) * PREFIXES[found[2].lower()] if found else 0.0
    if not value:
        raise library.wrong(name, f"must be a number and a unit such as 1p{base}, not {text}")
    return value


def _cell(name: str, cell: Entry, scales: Scales) -> Cell:
    """Return one cell of a library group."""
    pins = {pin: _pin(pin, entry, scales) for pin, entry in cell.named("pin").items()}
    states = [(group.text("when"), group.number("value") * scales.leakage) for group in cell.all("leakage_power")]
    leakage = cell.number("cell_leakage_power", math.nan) * scales.leakage
    if math.isnan(leakage):
        always = [power for when, power in states if not when]
        leakage = always[0] if always else sum(power for _, power in states) / max(len(states), 1)
    return Cell(
        name,
        cell.number("area", least=0.0),
        leakage,
        [state for state in states if state[0]],
        pins,
        _memory(cell, pins),
        cell.text("clock_gating_integrated_cell"),
        cell.flag("dont_use"),
        cell,
    )


def _pin(name: str, pin: Entry, scales: Scales) -> Pin:
    """Return one pin of a cell group."""
    capacitance = pin.number("capacitance", math.nan, least=0.0) * scales.capacitance
    capacitance = scales.capacitance_f if math.isnan(capacitance) else capacitance
    edges = [pin.number(f"{edge}_capacitance", least=0.0) * scales.capacitance for edge in EDGES.values()]
    if (direction := pin.text("direction")) not in DIRECTIONS:
        raise pin.wrong("direction", f"must be one of {', '.join(DIRECTIONS)}, not {direction or 'missing'}")
    roles = [role for role in ("clock", "enable", "out", "test") if pin.flag(f"clock_gate_{role}_pin")]
    return Pin(
        name,
        direction,
        pin.text("function"),
        pin.text("three_state"),
        capacitance,
        max(capacitance, *edges),
        pin.flag("clock"),
        roles[-1] if roles else "",
        pin,
        scales,
    )


def _memory(cell: Entry, pins: dict[str, Pin]) -> Memory | None:
    """Return the state described by the first ff or latch group."""
    for kind, when, stored in (("ff", "clocked_on", "next_state"), ("latch", "enable", "data_in")):
        for group in cell.all(kind):
            state, inverse = group.names(2)
            levels = {state: False, inverse: True, f"!{state}": True, f"!{inverse}": False}
            driven = {name: literal(pin.function) for name, pin in pins.items() if pin.direction != "input"}
            return Memory(
                kind == "ff",
                state,
                inverse,
                group.text(when),
                group.text(stored),
                group.text("clear"),
                group.text("preset"),
                group.text("clear_preset_var1"),
                {name: levels[text] for name, text in driven.items() if text in levels},
            )
    return None
