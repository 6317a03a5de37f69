"""A cell library: its cells, what they do, and their tables, as ``liberty-parser`` reads them."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flow.asic.library import Library, parse, read
from model.errors import InputError

UNITS = {"f": 1e-15, "p": 1e-12, "n": 1e-9, "u": 1e-6, "m": 1e-3, "": 1.0, "k": 1e3}


def text_of(value: Any) -> str:
    """Return an attribute as text without quotes; empty where it is absent."""
    return "" if value is None else str(value).strip('"').strip()


def number_of(value: Any, default: float = 0.0) -> float:
    """Return an attribute as a number."""
    return default if value is None else float(text_of(value))


@dataclass(frozen=True)
class LibraryCell:
    """A cell of a library.

    Attributes
    ----------
    name : str
    group : liberty.types.Group
        All that the file says of it.
    """

    name: str
    group: Any

    @functools.cached_property
    def pins(self) -> dict[str, Any]:
        """Groups of its pins by their names."""
        return {text_of(pin.args[0]): pin for pin in self.group.get_groups("pin")}

    def of_direction(self, direction: str) -> list[str]:
        """Return the names of its pins of a direction."""
        return [name for name, pin in self.pins.items() if text_of(pin["direction"]) == direction]

    @property
    def state(self) -> Any:
        """Its ``ff`` or ``latch`` group, or None."""
        found = [group for kind in ("ff", "latch") for group in self.group.get_groups(kind)]
        return found[0] if found else None

    @property
    def is_flop(self) -> bool:
        """Whether it has an ``ff`` group."""
        return bool(self.group.get_groups("ff"))

    @property
    def clock_gate(self) -> str:
        """Kind of an integrated clock gate, ``latch_posedge``; empty for other cells."""
        return text_of(self.group["clock_gating_integrated_cell"])

    @property
    def clock_pins(self) -> list[str]:
        """Inputs that carry a clock: that of a flop or latch, and of a clock gate."""
        return [name for name in self.of_direction("input") if text_of(self.pins[name]["clock"]) == "true"]

    def marked(self, attribute: str) -> str:
        """Return the pin with an attribute that is true, ``clock_gate_enable_pin``; empty where there is none."""
        return next((name for name, pin in self.pins.items() if text_of(pin[attribute]) == "true"), "")


@dataclass(frozen=True)
class CellLibrary:
    """All that a cell library says.

    Attributes
    ----------
    known : Library
        What the flow knows of its cells.
    group : liberty.types.Group
        The file as it stands.
    """

    known: Library
    group: Any

    @classmethod
    def read(cls, path: Path) -> CellLibrary:
        """Return the library of a file, or raise InputError if it is none."""
        return cls(read(path), parse(path))

    @functools.cached_property
    def content(self) -> bytes:
        """Bytes of the file."""
        return self.known.path.read_bytes()

    @functools.cached_property
    def cells(self) -> dict[str, LibraryCell]:
        """Its cells by their names."""
        groups = self.group.get_groups("cell")
        return {name: LibraryCell(name, group) for group in groups for name in [text_of(group.args[0])]}

    @functools.cached_property
    def templates(self) -> dict[str, Any]:
        """Groups of table templates by their names."""
        kinds = ("lu_table_template", "power_lut_template")
        return {text_of(group.args[0]): group for kind in kinds for group in self.group.get_groups(kind)}

    def unit(self, attribute: str, default: str) -> float:
        """Return a unit of the library in SI units, ``leakage_power_unit``."""
        found = re.fullmatch(r"([\d.]+)([a-z]?)[a-zA-Z]+", text_of(self.group[attribute]) or default)
        assert found, attribute
        return float(found[1]) * UNITS[found[2] if found[2] in UNITS else ""]

    @property
    def supply_v(self) -> float:
        """Nominal supply in volts."""
        return number_of(self.group["nom_voltage"]) * self.unit("voltage_unit", "1V")

    @property
    def time_s(self) -> float:
        """Unit of time in seconds."""
        return self.unit("time_unit", "1ns")

    @property
    def capacitance_f(self) -> float:
        """Unit of capacitance in farads."""
        value = self.group["capacitive_load_unit"] or [1, "pf"]
        return float(text_of(value[0])) * UNITS[text_of(value[1]).lower()[0]]

    @property
    def leakage_w(self) -> float:
        """Unit of leakage in watts."""
        return self.unit("leakage_power_unit", "1nW")

    def used(self, kinds: set[str]) -> Iterator[LibraryCell]:
        """Yield the cells of some names, in order of these."""
        for kind in sorted(kinds):
            if kind not in self.cells:
                raise InputError(f"the cell library {self.known.path} has no cell {kind}; give the one of the netlist")
            yield self.cells[kind]


# -- boolean expressions -----------------------------------------------------------------------------


@functools.cache
def expression(text: str) -> Any:
    """Return an expression of the library as sympy has it."""
    from liberty.boolean_functions import parse_boolean_function

    try:
        return parse_boolean_function(text)
    except Exception as error:
        raise InputError(f"the expression {text!r} of the cell library cannot be read: {error}") from None


@functools.cache
def verilog_of(text: str) -> str:
    """Return an expression of the library as Verilog.

    Examples
    --------
    >>> verilog_of("!(A B')")
    '(B | ~A)'
    """
    return _written(expression(text))


def _written(value: Any) -> str:
    from sympy.logic import boolalg

    if value in (boolalg.true, boolalg.false):
        return "1'b1" if value == boolalg.true else "1'b0"
    if not value.args:
        return str(value)
    words = [_written(argument) for argument in sorted(value.args, key=str)]
    if isinstance(value, boolalg.Not):
        return f"~{words[0]}"
    return "(" + f" {({'And': '&', 'Or': '|', 'Xor': '^'})[type(value).__name__]} ".join(words) + ")"
