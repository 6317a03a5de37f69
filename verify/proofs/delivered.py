"""Prove the delivered Verilog equivalent, module by module, to the RTLIL used in the other proofs.

Modules, ports, instances and memories of both must have the same names. Within a module every output, every input of
an instance or memory, and every register of the same name on both sides is a point. Yosys proves each point equal for
all inputs and all values of the points before it, by induction where one clock is not enough. What is inside an
instance is proved with its own module, so a large array takes seconds.
"""

import json
import re
from typing import Any

from eskin.rtl import yosys
from eskin.rtl.verilog import Config, rtlil, verilog

READ = {"gold": "read_rtlil gold.il", "gate": "read_verilog gate.v"}
NETS = (
    "; proc; opt_clean; async2sync; memory -nomap -nordff; memory_nordff; opt_expr -mux_undef; opt_clean; "
    "write_json {side}.json; design -reset; "
)
"""Registers of what a memory reads are registers like others; where nothing is written the address may be any."""

PROVE = "read_json {side}.json; design -stash {side}; "
PAIR = (
    "design -copy-from gold -as {name}_gold {name}; design -copy-from gate -as {name}_gate {name}; "
    "equiv_make {name}_gold {name}_gate {name}_equiv; "
)
SOLVE = "select *_equiv; opt_clean; equiv_simple{undef}; equiv_induct{undef}; tee -q -o said.txt equiv_status"
UNPROVEN = re.compile(r"Unproven \$equiv \S+: (.*)")
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
        Compare initial values of registers and memories too, as an FPGA has them, and allow undefined constants where
        the RTLIL has them.

    Raises
    ------
    Different
        If the texts do not have the same modules, ports, instances and memories, or if a point is not proved equal.
    """
    undefined = UNDEFINED.search(gate_verilog)
    if undefined and not initial:
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
    opened = {
        side: {name: _opened(design, name) for name in design} for side, design in (("gold", gold), ("gate", gate))
    }
    numbers = {name: f"module_{number}" for number, name in enumerate(gold)}
    files = {
        f"{side}.json": json.dumps({"modules": {numbers[name]: module for name, module in modules.items()}}).encode()
        for side, modules in opened.items()
    }
    script = "".join(PROVE.format(side=side) for side in READ)
    script += "".join(PAIR.format(name=name) for name in numbers.values()) + SOLVE.format(
        undef=" -undef" * bool(undefined)
    )
    said = yosys.run(script, "", "said.txt", files)
    points = {}
    for name, number in numbers.items():
        of_module = re.search(rf"Found (\d+) \$equiv cells in {number}_equiv:\n(?:  .*\n)*", said)
        if not of_module:
            raise Different(f"nothing is compared in {name}")
        unproven = UNPROVEN.findall(of_module[0])
        if unproven or f"{of_module[1]} are proven and 0 are unproven" not in of_module[0]:
            raise Different(f"{name}: not proved equal: {', '.join(unproven).replace(chr(92), '')}")
        points[name] = int(of_module[1])
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
    highest = max(
        (bit for net in module["netnames"].values() for bit in net["bits"] if isinstance(bit, int)), default=1
    )
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


def _memory_ports(cell: Design) -> dict[str, tuple[str, int]]:
    """Return a dictionary from the name of each port of a memory, except read clocks, to direction and width."""
    pins = cell["connections"].items()
    return {name: (cell["port_directions"][name], len(bits)) for name, bits in pins if name != "RD_CLK"}
