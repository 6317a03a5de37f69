"""Read a flat netlist of library cells, and write it as plain Verilog."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from eskin.flow.asic.equivalence import flat_design

WIDE = 32
"""Width from which on an output port is split: an event-driven simulator copies all bits when one bit changes."""
CONSTANTS = {"0": "1'b0", "1": "1'b1", "x": "1'bx", "z": "1'bz"}
APART = str.maketrans("[]", "__")
"""Translation of the name of a bit to the name of a wire."""


@dataclass(frozen=True)
class Port:
    """A port of the top module: direction, and nets of its bits, lowest first."""

    name: str
    direction: str
    nets: tuple[str, ...]


@dataclass(frozen=True)
class Cell:
    """An instance of a library cell."""

    name: str  # name in the flat Verilog, ``c`` and a number
    place: str  # hierarchical name, ``row_0.taxel_1._12_``
    kind: str
    pins: dict[str, str]  # net of every connected pin


@dataclass(frozen=True)
class FlatNetlist:
    """A netlist without hierarchy."""

    top: str
    ports: tuple[Port, ...]
    cells: tuple[Cell, ...]

    @property
    def nets(self) -> set[str]:
        """Names of all nets connected to a port or a pin, without constants."""
        found = {net for port in self.ports for net in port.nets}
        found |= {net for cell in self.cells for net in cell.pins.values()}
        return found - set(CONSTANTS.values())

    def verilog(self, gather: bool = False) -> str:
        """Return the netlist as Verilog with plain names.

        ``gather`` is for an event-driven simulation in units of 1 ns: output ports of at least ``WIDE`` bits are then
        assembled once, 1 ns after each clock edge, instead of at every change of a bit.
        """
        late = {port.name: port for port in self.ports if gather and port.direction == "output" and _wide(port)}
        names = {bit: bit.translate(APART) for port in late.values() for bit in _bits(port.name, len(port.nets))}
        inner = sorted((net for net in self.nets if re.fullmatch(r"n\d+", net)), key=lambda net: int(net[1:]))
        lines = [f"module {self.top} ({', '.join(port.name for port in self.ports)});"]
        for port in self.ports:
            width = f"[{len(port.nets) - 1}:0] " if len(port.nets) > 1 else ""
            lines.append(f"  {port.direction} {'reg ' if port.name in late else ''}{width}{port.name};")
        lines += [f"  wire {net};" for net in [*inner, *names.values()]]
        lines += [f"  assign {names.get(name, name)} = {names.get(net, net)};" for name, net in self._aliases()]
        for cell in self.cells:
            pins = ", ".join(f".{pin}({names.get(net, net)})" for pin, net in cell.pins.items())
            lines.append(f"  {cell.kind} {cell.name} ({pins});")
        for name, port in late.items():
            whole = ", ".join(names[bit] for bit in reversed(_bits(name, len(port.nets))))
            lines.append(f"  always @(clk) #1 {name} = {{{whole}}};")
        return "\n".join([*lines, "endmodule", ""])

    def _aliases(self) -> Iterator[tuple[str, str]]:
        """Yield the output port bits that share a net with another name."""
        for port in self.ports:
            for name, net in zip(_bits(port.name, len(port.nets)), port.nets, strict=True):
                if port.direction == "output" and name != net:
                    yield name, net


def flatten(text: str, top: str, liberty: bytes) -> FlatNetlist:
    """Return the flat form of a Verilog netlist; see ``flat_design``."""
    module = flat_design(text, top, liberty)["modules"][top]
    named = _names_of_ports(module["ports"])

    def net(bit: int | str) -> str:
        return CONSTANTS[bit] if isinstance(bit, str) else named.get(bit, f"n{bit}")

    ports = tuple(
        Port(name, port["direction"], tuple(map(net, port["bits"]))) for name, port in module["ports"].items()
    )
    cells = tuple(
        Cell(
            f"c{number}", place, cell["type"], {pin: net(bits[0]) for pin, bits in cell["connections"].items() if bits}
        )
        for number, (place, cell) in enumerate(sorted(module["cells"].items()))
    )
    return FlatNetlist(top, ports, cells)


def _names_of_ports(ports: dict[str, dict]) -> dict[int, str]:
    """Return the net name of every port; an input gives its name to a shared net."""
    named: dict[int, str] = {}
    for direction in ("output", "input"):
        for name, port in ports.items():
            if port["direction"] == direction:
                named |= {
                    bit: bit_name
                    for bit, bit_name in zip(port["bits"], _bits(name, len(port["bits"])), strict=True)
                    if not isinstance(bit, str)
                }
    return named


def _wide(port: Port) -> bool:
    return len(port.nets) >= WIDE


def _bits(name: str, width: int) -> list[str]:
    return [name] if width == 1 else [f"{name}[{bit}]" for bit in range(width)]
