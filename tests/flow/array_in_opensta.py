"""Independent timing of a small array by OpenSTA."""

from __future__ import annotations

import re
from collections.abc import Iterator

from eskin.flow import opensta
from eskin.flow.asic.constraints import sdc
from eskin.flow.asic.synthesis import Netlist
from eskin.flow.liberty.library import Library
from eskin.flow.scale.array import NONE, TAXEL, Array
from eskin.flow.scale.timing import Timing
from eskin.rtl.verilog import top_block

ROUNDS = 14
ZERO = "1'b0"
SCRIPT = """\
read_liberty cells.lib
read_verilog netlist.v
link_design {top}
read_spef wires.spef
set low 0.0
set high {high}
for {{set i 0}} {{$i < {rounds}}} {{incr i}} {{
  set period [expr ($low + $high) / 2]
  source constraints.sdc
  if {{[worst_slack -max] < 0}} {{ set low $period }} else {{ set high $period }}
}}
puts "PERIOD <<$high>>"
"""


def period_s(timing: Timing, library: Library) -> float:
    """Return the shortest clock period that OpenSTA finds with the estimated wires, to 1/8192 of the estimate."""
    array = timing.array
    made = Netlist("", top_block(array.config).module_name, array.config, library, True)
    high = 2e9 * timing.worst().period_s
    files: dict[str, str | bytes] = {"netlist.v": verilog(array), "wires.spef": spef(timing)}
    files |= {"constraints.sdc": sdc(made, "$period"), "cells.lib": OWN_WIRES.sub(b"", library.content)}
    said = opensta.run(SCRIPT.format(top=made.top, high=high, rounds=ROUNDS), files)
    return float(said.values["PERIOD"]) * 1e-9


def verilog(array: Array) -> str:
    """Return the array as Verilog with cells ``c0``, taxels ``t0``, taxel cells ``g0`` and nets ``n0``."""
    top = top_block(array.config).module_name
    widths: dict[str, tuple[str, int]] = {}
    for way, name, bit, _ in array.ports:
        widths[name] = way, max(bit + 1, widths.get(name, ("", 0))[1])
    lines = [f"module {top}({', '.join(widths)});"]
    lines += [f"  {way} {f'[{width - 1}:0] ' if width > 1 else ''}{name};" for name, (way, width) in widths.items()]
    nets = {net: f"n{net}" for net in range(array.nets)} | {NONE: ZERO}
    for way, name, bit, net in array.ports:
        port = f"{name}[{bit}]" if widths[name][1] > 1 else name
        if net >= 0 and nets[net].startswith("n"):
            nets[net] = port
        elif way == "output":
            lines.append(f"  assign {port} = {nets[net]};")
    lines += [f"  wire n{net};" for net in range(array.nets) if nets[net] == f"n{net}"]
    for number, (kind, pins) in enumerate(zip(array.cells, array.pins, strict=True)):
        lines.append(f"  {kind} c{number} ({', '.join(f'.{pin}({nets[net]})' for pin, net in pins.items())});")
    for number, taxel in enumerate(array.taxels):
        lines.append(f"  {TAXEL} t{number} ({', '.join(f'.{_plain(p)}({nets[net]})' for p, net in taxel.items())});")
    return "\n".join([*lines, "endmodule", *_taxel(array)]) + "\n"


def _plain(bit: str) -> str:
    return "p_" + bit.replace(" ", "_")


def _taxel(array: Array) -> Iterator[str]:
    """Yield the lines of the taxel module."""
    names: dict[object, str] = {}
    lines = [f"module {TAXEL}({', '.join(map(_plain, array.taxel_bits))});"]
    for bit, (way, own) in array.taxel_bits.items():
        lines.append(f"  {way} {_plain(bit)};")
        if isinstance(own, int) and own not in names:
            names[own] = _plain(bit)
        else:
            lines.append(f"  assign {_plain(bit)} = {names.get(own, ZERO)};")
    inner: set[str] = set()
    cells = []
    for number, cell in enumerate(array.taxel["cells"].values()):
        pins = []
        for pin, bits in cell["connections"].items():
            net = ZERO if not bits or isinstance(bits[0], str) else names.get(bits[0], f"n{bits[0]}")
            inner |= {net} if net.startswith("n") else set()
            pins.append(f".{pin}({net})")
        cells.append(f"  {cell['type']} g{number} ({', '.join(pins)});")
    yield from (*lines, *(f"  wire {net};" for net in sorted(inner)), *cells, "endmodule")


def spef(timing: Timing) -> str:
    """Return the wire capacitances as SPEF, without resistances."""
    array = timing.array
    names = {net: f"n{net}" for net in range(array.nets)}
    single = {name for _, name, bit, _ in array.ports} - {name for _, name, bit, _ in array.ports if bit > 0}
    ends: dict[int, list[str]] = {}
    for way, name, bit, net in array.ports:
        port = name if name in single else f"{name}[{bit}]"
        if net >= 0:
            names[net] = port if names[net] == f"n{net}" else names[net]
            ends.setdefault(net, []).append(f"*P {port} {way[0].upper()}")
    pins = [0.0] * timing.nets
    for group in timing.groups.values():
        for pin, nets in group.pins.items():
            out, load = pin in group.kind.outputs, group.kind.loads.get(pin, 0.0)
            for cell, net in zip(group.cells, nets, strict=True):
                if net >= 0:
                    pins[net] += load
                    path = f"*I {_path(array, int(cell))}:{pin} {'O' if out else 'I'}"
                    ends.setdefault(int(net), []).insert(0 if out else len(ends.get(int(net), [])), path)
    found = []
    for net, on in ends.items():
        taxel, inner = divmod(net - array.nets, len(timing.inner) or 1)
        name = names[net] if net < array.nets else f"t{taxel}/n{timing.inner[inner]}"
        wire_pf = 1e12 * max(timing.load[net] - pins[net] - (array.port_load_f if "*P" in on[-1] else 0.0), 0.0)
        found.append((name, wire_pf, on))
    return opensta.spef(found)


OWN_WIRES = re.compile(rb"^\s*default_wire_load\w* .*$", re.MULTILINE)
"""What a library itself says of wires, which OpenSTA takes wherever nothing else does."""


def _path(array: Array, cell: int) -> str:
    if cell < len(array.cells):
        return f"c{cell}"
    taxel, number = divmod(cell - len(array.cells), len(array.taxel["cells"]))
    return f"t{taxel}/g{number}"
