"""A cell library: its cells, what they do, and their tables, as ``liberty-parser`` reads them."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flow.asic.library import Library, parse, read, text_of
from model.errors import InputError


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

    @functools.cached_property
    def _directions(self) -> dict[str, str]:
        return {name: text_of(pin["direction"]) for name, pin in self.pins.items()}

    def of_direction(self, direction: str) -> list[str]:
        """Return the names of its pins of a direction."""
        return [name for name, found in self._directions.items() if found == direction]

    @functools.cached_property
    def state(self) -> Any:
        """Its ``ff`` or ``latch`` group, or None."""
        found = [group for kind in ("ff", "latch") for group in self.group.get_groups(kind)]
        return found[0] if found else None

    @functools.cached_property
    def is_flop(self) -> bool:
        """Whether it has an ``ff`` group."""
        return bool(self.group.get_groups("ff"))

    @functools.cached_property
    def clock_gate(self) -> str:
        """Kind of an integrated clock gate, ``latch_posedge``; empty for other cells."""
        return text_of(self.group["clock_gating_integrated_cell"])

    @functools.cached_property
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
