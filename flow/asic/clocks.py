"""Analyse the clock network of a clock-gated netlist: the clock and the clock gates of every flop."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

from eskin.flow.liberty.boolean import possible
from eskin.flow.liberty.library import Cell, Library
from eskin.rtl.gates.cells import Bit

Pins = dict[str, list[Bit]]

SIMPLE = {"$_AND_": "A & B", "$_OR_": "A | B", "$_NOT_": "!A", "$_MUX_": "(A & !S) | (B & S)"}
"""Functions of the logic gates of Yosys that ``with_enables`` adds to a netlist."""


class ClockError(ValueError):
    """Raised for a clock network that is not known to be glitch-free."""


@dataclass
class Clocks:
    """The clock network of a flat netlist."""

    module: dict[str, Any]  # top module, as ``write_json`` of Yosys returns it
    library: Library
    clock: str = "clk"

    def __post_init__(self) -> None:
        self.root: Bit = self.module["ports"][self.clock]["bits"][0]
        self.driver: dict[Bit, tuple[str, str]] = {}
        for name, cell in self.module["cells"].items():
            known = self.library.cells[cell["type"]]
            for pin, bits in cell["connections"].items():
                if pin not in known.inputs:
                    self.driver |= dict.fromkeys(bits, (name, pin))
        self._levels: dict[tuple[bool, Bit | None], dict[Bit, str]] = {}
        self._sources: dict[Bit, frozenset[str]] = {self.root: frozenset({self.clock})}

    def cell(self, name: str) -> tuple[Cell, Pins]:
        """Return the library cell and the connections of an instance."""
        instance = self.module["cells"][name]
        return self.library.cells[instance["type"]], instance["connections"]

    def having(self, part: Literal["flop", "latch", "gate"]) -> Iterator[tuple[str, Cell, Pins]]:
        """Yield name, cell and connections of every flop, latch or integrated clock gate."""
        for name in self.module["cells"]:
            cell, pins = self.cell(name)
            if getattr(cell, part):
                yield name, cell, pins

    def level(self, bit: Bit, clock: bool, stopped: Bit | None = None) -> str:
        """Return the value of a net while the clock is low or high: "0", "1", or "x" if it depends on other nets.

        A net that is ``stopped`` counts as low.
        """
        key = (clock, stopped)
        if key not in self._levels:
            known = {self.root: "01"[clock]} | ({} if stopped is None else {stopped: "0"})
            self._levels[key] = levels(self.module, self.library, known)
        return value(bit, self._levels[key])

    def sources(self, bit: Bit) -> frozenset[str]:
        """Return the latches, and the clock port, that drive a net through combinational cells and clock gates only."""
        if bit not in self._sources:
            self._sources[bit] = frozenset()  # round a loop
            if bit in self.driver:
                name, _ = self.driver[bit]
                cell, pins = self.cell(name)
                inputs = [cell.gate.clock] if cell.gate else [] if cell.flop else cell.inputs
                behind = [self.sources(b) for pin in inputs for b in pins.get(pin, [])] if not cell.latch else []
                self._sources[bit] = frozenset({name} if cell.latch else ()).union(*behind)
        return self._sources[bit]

    def is_clock(self, bit: Bit) -> bool:
        """Return True if a net is a clock: the clock port, or a gated clock that is low while the clock is low."""
        return bit == self.root or (self.level(bit, False) == "0" and self.level(bit, True) != "0")

    def clock_of(self, cell: Cell, pins: Pins) -> Bit | None:
        """Return the clock whose low phase opens a latch, or None."""
        assert cell.latch
        bit, inverted = pins[cell.latch.clock][0], False
        while not self.is_clock(bit):
            if bit not in self.driver:
                return None
            name, pin = self.driver[bit]
            driver, sources = self.cell(name)
            if driver.flop or driver.latch or driver.gate or len(driver.inputs) != 1 or pin not in driver.functions:
                return None
            (source,) = driver.inputs
            inverted ^= possible(driver.functions[pin], ((source, "0"),)) == "1"
            bit = sources[source][0]
        return bit if inverted == cell.latch.rising else None

    def check(self, flop: str, bit: Bit) -> None:
        """Raise ClockError if the clock of a flop can rise while the latch of its clock gate is transparent."""
        if not self.is_clock(bit):
            raise ClockError(f"the clock of the flop {flop} is not low while {self.clock} is low")
        for name in self.sources(bit) - {self.clock}:
            parent = self.clock_of(*self.cell(name))
            if parent is None or self.level(bit, True, parent) != "0":
                raise ClockError(f"the latch {name} may be open while the clock of the flop {flop} is high")


def value(bit: Bit, known: dict[Bit, str]) -> str:
    """Return the value of a net or a constant: "0", "1", or "x" if unknown."""
    return bit if isinstance(bit, str) else known.get(bit, "x")


def levels(module: dict[str, Any], library: Library, known: dict[Bit, str]) -> dict[Bit, str]:
    """Return the values of the nets of a module that follow from known nets and constants.

    Flops and latches have unknown outputs. A clock gate is low while its clock is low.
    """
    found = dict(known)
    waiting: dict[Bit, list[str]] = {}
    for name, instance in module["cells"].items():
        for bits in instance["connections"].values():
            for bit in bits:
                waiting.setdefault(bit, []).append(name)
    todo = list(module["cells"])
    while todo:
        instance = module["cells"][todo.pop()]
        pins, cell = instance["connections"], library.cells.get(instance["type"])
        functions = cell.functions if cell else {"Y": SIMPLE[instance["type"]]}
        inputs = tuple((pin, value(bits[0], found)) for pin, bits in pins.items() if pin not in functions and bits)
        if cell and cell.gate:
            clock = value(pins[cell.gate.clock][0], found)
            functions, inputs = {cell.gate.gated: "CLOCK"}, (("CLOCK", "0" if clock == "0" else "x"),)
        elif cell and (cell.flop or cell.latch):
            continue
        for output, function in functions.items():
            for bit in pins.get(output, []):
                if bit not in found and (result := possible(function, inputs)) != "x":
                    found[bit] = result
                    todo += waiting[bit]
    return found
