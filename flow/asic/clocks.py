"""Analyse the clock network of a clock-gated netlist: the clock and the clock gates of every flop."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

from eskin.flow.liberty.boolean import possible
from eskin.flow.liberty.library import Cell, Library
from eskin.rtl.gates.cells import Bit

Pins = dict[str, list[Bit]]


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
        self._level: dict[tuple[Bit, bool, Bit | None], str] = {}
        self._latches: dict[Bit, frozenset[str]] = {}
        self._touches: dict[Bit, bool] = {self.root: True}

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
        if isinstance(bit, str):
            return bit
        if bit == stopped:
            return "0"
        if bit == self.root:
            return "01"[clock]
        key = (bit, clock, stopped)
        if key not in self._level:
            self._level[key] = "x"  # through a flop, or round a loop
            self._level[key] = self._driven(bit, clock, stopped)
        return self._level[key]

    def _driven(self, bit: Bit, clock: bool, stopped: Bit | None) -> str:
        if bit not in self.driver:
            return "x"
        name, pin = self.driver[bit]
        cell, pins = self.cell(name)
        if cell.gate:
            return "0" if self.level(pins[cell.gate.clock][0], clock, stopped) == "0" else "x"
        if cell.flop or cell.latch or pin not in cell.functions:
            return "x"
        known = {name: self.level(pins[name][0], clock, stopped) for name in cell.inputs}
        return possible(cell.functions[pin], tuple(known.items()))

    def touches(self, bit: Bit) -> bool:
        """Return True if the clock port or a latch drives a net through combinational cells and clock gates only."""
        if bit not in self._touches:
            self._touches[bit] = False  # round a loop
            if bit in self.driver:
                cell, pins = self.cell(self.driver[bit][0])
                inputs = [cell.gate.clock] if cell.gate else [] if cell.flop else cell.inputs
                touching = any(self.touches(b) for pin in inputs for b in pins.get(pin, []))
                self._touches[bit] = cell.latch is not None or touching
        return self._touches[bit]

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

    def latches_behind(self, bit: Bit) -> frozenset[str]:
        """Return the latches that drive a net through combinational cells and clock gates only."""
        if bit not in self._latches:
            self._latches[bit] = frozenset()  # round a loop
            if bit in self.driver and self.touches(bit):
                name, _ = self.driver[bit]
                cell, pins = self.cell(name)
                inputs = [cell.gate.clock] if cell.gate else cell.inputs
                behind = [self.latches_behind(b) for pin in inputs for b in pins.get(pin, [])]
                self._latches[bit] = frozenset({name}) if cell.latch else frozenset().union(*behind)
        return self._latches[bit]

    def check(self, flop: str, bit: Bit) -> None:
        """Raise ClockError if the clock of a flop can rise while the latch of its clock gate is transparent."""
        if not self.is_clock(bit):
            raise ClockError(f"the clock of the flop {flop} is not low while {self.clock} is low")
        for name in self.latches_behind(bit):
            parent = self.clock_of(*self.cell(name))
            if parent is None or self.level(bit, True, parent) != "0":
                raise ClockError(f"the latch {name} may be open while the clock of the flop {flop} is high")
