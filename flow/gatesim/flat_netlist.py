"""Read a flat netlist of library cells, and write it as plain Verilog."""

import re
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

    @property
    def bits(self) -> list[str]:
        """Names of the bits, lowest first."""
        return _bits(self.name, len(self.nets))


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
        outputs = [port for port in self.ports if port.direction == "output"]
        late = {port.name: port for port in outputs if gather and len(port.nets) >= WIDE}
        names = {bit: bit.translate(APART) for port in late.values() for bit in port.bits}
        inner = sorted((net for net in self.nets if re.fullmatch(r"n\d+", net)), key=lambda net: int(net[1:]))
        lines = [f"module {self.top} ({', '.join(port.name for port in self.ports)});"]
        for port in self.ports:
            width = f"[{len(port.nets) - 1}:0] " if len(port.nets) > 1 else ""
            lines.append(f"  {port.direction} {'reg ' if port.name in late else ''}{width}{port.name};")
        lines += [f"  wire {net};" for net in [*inner, *names.values()]]
        aliases = [pair for port in outputs for pair in zip(port.bits, port.nets, strict=True) if pair[0] != pair[1]]
        lines += [f"  assign {names.get(name, name)} = {names.get(net, net)};" for name, net in aliases]
        for cell in self.cells:
            pins = ", ".join(f".{pin}({names.get(net, net)})" for pin, net in cell.pins.items())
            lines.append(f"  {cell.kind} {cell.name} ({pins});")
        for name, port in late.items():
            whole = ", ".join(names[bit] for bit in reversed(port.bits))
            lines.append(f"  always @(clk) #1 {name} = {{{whole}}};")
        return "\n".join([*lines, "endmodule", ""])


def flatten(text: str, top: str, liberty: bytes) -> FlatNetlist:
    """Return the flat form of a Verilog netlist; see ``flat_design``."""
    module = flat_design(text, top, liberty)["modules"][top]
    named = {  # an input gives its name to a shared net
        bit: name
        for way in ("output", "input")
        for port, found in module["ports"].items()
        if found["direction"] == way
        for bit, name in zip(found["bits"], _bits(port, len(found["bits"])), strict=True)
    }

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


def _bits(name: str, width: int) -> list[str]:
    return [name] if width == 1 else [f"{name}[{bit}]" for bit in range(width)]
