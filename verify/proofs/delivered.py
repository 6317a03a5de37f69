"""Prove the delivered Verilog equivalent, module by module, to the RTLIL used in the other proofs.

Modules, ports, instances and memories of both must have the same names. Within a module every output, every input of
an instance or memory, and every register is a point. A point must be the same function of registers and inputs on both
sides. Nothing is assumed about which states can be reached. The content of an instance is proved with its own module,
so a large array takes seconds.
"""

import json
import re
from typing import Any

from eskin.flow.asic.compare import FLOP, compare
from eskin.rtl import yosys
from eskin.rtl.gates.cells import Bit, highest_net
from eskin.rtl.verilog import Config, rtlil, verilog

READ = {"gold": "read_rtlil gold.il", "gate": "read_verilog gate.v"}
NETS = (
    "; proc; opt_clean; memory -nomap -nordff; memory_nordff; opt_expr -mux_undef; opt_clean; "
    "techmap; dffunmap; simplemap; opt_clean; write_json {side}.json; design -reset; "
)
"""Registers of what a memory reads are registers like others; where nothing is written the address may be any."""

SPELLED = re.compile(r"\\?\$(signal)\$(\d+)$|\b(memory)\[(\d+)\]$")
"""Names in RTLIL that the Verilog writes with an underscore: unnamed signals, and words of flops."""

UNDEFINED = re.compile(r"'s?[bdho][0-9a-f_]*[xz]")
MEMORY = "$mem_v2"
DATA = ("INIT", "MEMID", "RD_CLK_POLARITY", "RD_INIT_VALUE", "RD_ARST_VALUE", "RD_SRST_VALUE")
"""Parameters of a memory that say nothing about one whose reads have no clock: its content is compared apart."""

Design = dict[str, Any]


class Different(AssertionError):
    """Raised if the Verilog is not proved equivalent to the RTLIL."""


def prove(gold_rtlil: str, gate_verilog: str, initial: bool = False) -> dict[str, int]:
    """Return the number of points proved equivalent in each module.

    Parameters
    ----------
    gold_rtlil, gate_verilog : str
        Both texts, with modules of the same names.
    initial : bool
        Compare initial values of registers and memories too, as an FPGA has them.

    Raises
    ------
    Different
        If the texts do not have the same modules, ports, instances and memories, if a point is not proved equal, or if
        the Verilog has an undefined constant.
    """
    if undefined := UNDEFINED.search(gate_verilog):
        raise Different(f"the Verilog has the undefined constant {undefined[0]}")
    files = {"gold.il": gold_rtlil.encode(), "gate.v": gate_verilog.encode()}
    script = "".join(READ[side] + NETS.format(side=side) for side in READ)
    texts = yosys.run_for(script, "", [f"{side}.json" for side in READ], files)
    gold, gate = (json.loads(texts[f"{side}.json"])["modules"] for side in READ)
    _same("modules", dict.fromkeys(gold, ""), dict.fromkeys(gate, ""))
    for name in gold:
        _same(f"ports of {name}", _ports(gold[name]), _ports(gate[name]))
        _same(f"instances and memories of {name}", _cells(gold, name), _cells(gate, name))
        if initial:
            _same(f"initial values of {name}", _initial(gold[name]), _initial(gate[name]))
    for module in (*gold.values(), *gate.values()):
        module["netnames"] = {SPELLED.sub(r"\1\3_\2\4", net): bits for net, bits in module["netnames"].items()}
    both = [{name: _opened(design, name) for name in design} for design in (gold, gate)]
    points = {name: _points(module) for name, module in both[1].items()}
    if not all(points.values()):
        raise Different(f"nothing is compared in {min(points, key=lambda name: points[name])}")
    proved, differ = compare(*(_side_by_side(modules) for modules in both))
    if differ or proved != sum(points.values()):
        raise Different(f"not proved equal: {', '.join(differ[:5])}")
    return points


def prove_config(config: Config) -> dict[str, int]:
    """Return the number of points proved equivalent in each module of a configuration's Verilog."""
    return prove(rtlil(config), verilog(config))


def _same(what: str, gold: Any, gate: Any) -> None:
    if gold == gate:
        return
    differing = sorted(name for name in {*gold, *gate} if gold.get(name) != gate.get(name))
    raise Different(f"the {what} are not those of the RTLIL: {', '.join(differing)}")


def _ports(module: Design) -> dict[str, tuple[str, int]]:
    return {name: (port["direction"], len(port["bits"])) for name, port in module["ports"].items()}


def _cells(design: Design, name: str) -> dict[str, Any]:
    """Return the instances and memories of a module by name, with type or parameters."""
    found: dict[str, Any] = {}
    for cell_name, cell in design[name]["cells"].items():
        if cell["type"] == MEMORY:
            found[cell_name] = {key: value for key, value in cell["parameters"].items() if key not in DATA}
        elif cell["type"] in design:
            found[cell_name] = cell["type"]
    return found


def _initial(module: Design) -> dict[str, Any]:
    wires = {name: net["attributes"]["init"] for name, net in module["netnames"].items() if "init" in net["attributes"]}
    cells = module["cells"].items()
    return wires | {name: cell["parameters"]["INIT"] for name, cell in cells if cell["type"] == MEMORY}


def _opened(design: Design, name: str) -> Design:
    """Return a module with its instances and memories removed and their pins made ports."""
    module = json.loads(json.dumps(design[name]))
    highest = highest_net(module)
    for cell_name in _cells(design, name):
        cell = module["cells"].pop(cell_name)
        ports = _ports(design[cell["type"]]) if cell["type"] in design else _memory_ports(cell)
        for port, (direction, width) in ports.items():
            bits = cell["connections"].get(port, [])
            if not bits and direction == "output":  # left open
                bits = list(range(highest + 1, highest + 1 + width))
                highest += width
            if len(bits) != width:
                raise Different(f"{cell_name} of {name} has {len(bits)} bits at {port}, which has {width}")
            turned = "input" if direction == "output" else "output"
            module["ports"][f"{cell_name}.{port}"] = {"direction": turned, "bits": bits}
            module["netnames"][f"{cell_name}.{port}"] = {"hide_name": 0, "bits": bits, "attributes": {}}
    for net in module["netnames"].values():
        net["attributes"].pop("init", None)
    return module


def _points(module: Design) -> int:
    outputs = [port["bits"] for port in module["ports"].values() if port["direction"] == "output"]
    return sum(map(len, outputs)) + sum(FLOP.fullmatch(cell["type"]) is not None for cell in module["cells"].values())


def _side_by_side(modules: dict[str, Design]) -> Design:
    """Return one module with all cells, ports and nets of some modules, ``MODULE:NAME``, on nets of their own."""
    whole: Design = {"ports": {}, "cells": {}, "netnames": {}}
    first = 0
    for name, module in modules.items():

        def moved(bits: list[Bit], by: int = first) -> list[Bit]:
            return [bit + by if isinstance(bit, int) else bit for bit in bits]

        for cell in module["cells"].values():
            cell["connections"] = {pin: moved(bits) for pin, bits in cell["connections"].items()}
        for kind in ("ports", "netnames"):
            for entry in module[kind].values():
                entry["bits"] = moved(entry["bits"])
        for kind, entries in whole.items():
            entries |= {f"{name}:{entry}": found for entry, found in module[kind].items()}
        first = highest_net(module)
    return whole


def _memory_ports(cell: Design) -> dict[str, tuple[str, int]]:
    """Return a dictionary from the name of each port of a memory, except read clocks, to direction and width."""
    pins = cell["connections"].items()
    return {name: (cell["port_directions"][name], len(bits)) for name, bits in pins if name != "RD_CLK"}
