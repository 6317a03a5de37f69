"""Add cells to a module in the JSON netlist format of Yosys."""

from collections.abc import Mapping
from typing import Any

Bit = int | str
"""A net of a design of Yosys, or a constant "0", "1", "x"."""


def highest_net(module: dict[str, Any]) -> int:
    """Return the highest net number in a module."""
    return max(bit for net in module["netnames"].values() for bit in net["bits"] if isinstance(bit, int))


def cell_of(kind: str, pins: Mapping[str, Bit], output: str = "Y") -> dict[str, Any]:
    """Return a netlist cell with the given nets at its pins."""
    return {
        "hide_name": 1,
        "type": kind,
        "parameters": {},
        "attributes": {},
        "port_directions": {pin: "output" if pin == output else "input" for pin in pins},
        "connections": {pin: [bit] for pin, bit in pins.items()},
    }
