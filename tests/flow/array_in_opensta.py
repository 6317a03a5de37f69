"""Independent timing of a small array by OpenSTA, on a netlist that Yosys flattens."""

import json
import re
from collections import defaultdict
from typing import Any

from eskin.flow import programs
from eskin.flow.asic.constraints import sdc
from eskin.flow.asic.synthesis import Netlist
from eskin.flow.gatesim.flat_netlist import FlatNetlist, flatten
from eskin.flow.liberty.library import Library
from eskin.flow.scale.array import NONE, TAXEL, Array
from eskin.flow.scale.lines import Lines
from eskin.flow.scale.timing import Timing
from eskin.rtl import yosys
from eskin.rtl.verilog import top_block

ROUNDS = 14
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
OWN_WIRES = re.compile(rb"^\s*default_wire_load\w* .*$", re.MULTILINE)
"""What a library itself says of wires, which OpenSTA takes wherever nothing else does."""


def period_s(timing: Timing, lines: Lines, library: Library) -> float:
    """Return the shortest clock period that OpenSTA finds with the estimated wires, to 1/8192 of the estimate."""
    config = timing.array.config
    made = Netlist("", top_block(config).module_name, config, library, True)
    flat = flat_netlist(timing.array, made.top, library)
    files: dict[str, str | bytes] = {"netlist.v": flat.verilog(), "wires.spef": spef(timing, lines, flat)}
    files |= {"constraints.sdc": sdc(made, "$period"), "cells.lib": OWN_WIRES.sub(b"", library.content)}
    high = 2e9 * timing.worst().period_s
    said = programs.opensta(SCRIPT.format(top=made.top, high=high, rounds=ROUNDS), files)
    return float(said.values["PERIOD"]) * 1e-9


def flat_netlist(array: Array, top: str, library: Library) -> FlatNetlist:
    """Return an array as a flat netlist; the name of a cell in a taxel begins with the row and the column."""

    def bit(net: int) -> int | str:
        return "0" if net == NONE else net + 2

    ports: dict[str, dict[str, Any]] = {}
    for way, name, _, net in array.ports:
        ports.setdefault(name, {"direction": way, "bits": []})["bits"].append(bit(net))
    cells = {
        name: {"type": kind, "connections": {pin: [bit(net)] for pin, net in pins.items()}}
        for name, kind, pins in zip(array.names, array.cells, array.pins, strict=True)
    }
    for number, taxel in enumerate(array.taxels):
        bits = defaultdict(list)
        for name, net in taxel.items():
            bits[name.split()[0]].append(bit(net))
        row, column = divmod(number, array.config.columns)
        cells[f"row_{row}.taxel_{column}"] = {"type": TAXEL, "connections": bits}
    for cell in cells.values():
        cell |= {"parameters": {}, "attributes": {}}
    design = {"modules": {top: {"ports": ports, "cells": cells, "netnames": {}}, TAXEL: array.taxel}}
    script = f"read_liberty -lib -ignore_miss_func cells.lib; read_json array.json; hierarchy -check -top {top}; "
    files = {"cells.lib": library.content, "array.json": json.dumps(design).encode()}
    script += "setattr -mod -unset keep_hierarchy *; write_verilog array.v"
    return flatten(yosys.run(script, "", "array.v", files), top, library.content)


def spef(timing: Timing, lines: Lines, flat: FlatNetlist) -> str:
    """Return the wire capacitances as SPEF, without resistances."""
    placed = {cell.place: cell for cell in flat.cells}
    ends: dict[str, list[str]] = defaultdict(list)
    nets_of: dict[str, int] = {}
    removed_f: dict[int, float] = defaultdict(float)  # load of cells that nothing reads, which Yosys removes
    for group in timing.groups.values():
        for pin, nets in group.pins.items():
            drives = pin in group.kind.outputs
            for number, net in zip(group.cells, nets, strict=True):
                if cell := placed.get(timing.name(int(number))):
                    nets_of[cell.pins[pin]] = int(net)
                    on = ends[cell.pins[pin]]
                    on.insert(0 if drives else len(on), f"*I {cell.name}:{pin} {'IO'[drives]}")
                else:
                    removed_f[int(net)] += group.kind.loads.get(pin, 0.0)
    within_f = lines.wire.farad_per_um * lines.wire.within_um
    wires_f = {
        name: removed_f[net] + (lines.load_f.get(net, 0.0) if net < timing.array.nets else within_f * len(ends[name]))
        for name, net in nets_of.items()
    }
    for port in flat.ports:
        for number, net in enumerate(port.nets):
            name = f"{port.name}[{number}]" if len(port.nets) > 1 else port.name
            ends[net].insert(
                0 if port.direction == "input" else len(ends[net]), f"*P {name} {port.direction[0].upper()}"
            )
    return programs.spef((net, 1e12 * wires_f.get(net, 0.0), on) for net, on in ends.items() if "'" not in net)
