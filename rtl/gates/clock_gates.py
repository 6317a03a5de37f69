"""Insert clock gates into the generated Verilog, as instances of one module that maps to a library cell."""

import json
import re
from collections.abc import Collection
from typing import Any

from eskin.rtl import yosys
from eskin.rtl.gates.cells import cell_of, highest_net

GATE = "eskin_clock_gate"
TEST = "test_enable"
"""Port of the top, tied low in operation: high, it lets every clock through, as a scan chain needs."""

AWAKE = "awake"
"""Signal of a block in the RTL: low in a clock at whose end no register in it changes, links apart."""

LISTENS = ("eskin_link", "eskin_host")
"""Blocks whose clock never stops: they listen to what comes without a clock."""

SYNCHRONISERS = {
    "eskin_link": ("ack_meta", "ack_sync"),
    "eskin_loader": ("sck_flops", "cs_flops", "mosi_flops"),
    "eskin_spi": ("sck", "cs_n", "mosi"),
}
"""Registers that take what comes without a clock, by their modules."""

MEMORY = "$memrd_v2"
"""Cell of a read port. A macro may replace a module that has one, so no register of this module gets a gate."""

REGISTERS = ("$dff", "$dffe", "$adff", "$adffe")

FEWEST_FLOPS = 3
"""Flops with one enable that are worth a clock gate."""

BEHAVIOUR = f"""module {GATE}(
  input wire clk,
  input wire enable,
  input wire {TEST},
  output wire gated
);
  // For silicon replace the body by one cell of the library, an integrated clock gate:
  //   CELL gate (.CLK(clk), .E(enable), .TE({TEST}), .GCLK(gated));
  reg open;
  /* verilator lint_off LATCH */
  always @*
    if (!clk) open = enable | {TEST};
  /* verilator lint_on LATCH */
  assign gated = clk & open;
endmodule
"""
"""The module that is delivered: a latch that is open while the clock is low, and an AND."""

STUB = f"module {GATE}(input clk, input enable, input {TEST}, output gated); assign gated = enable; endmodule\n"
"""Its ports, for Yosys."""

FLOPS = "eskin_lane"
"""Block whose memory is made of flops, so that every word has an enable; the other memories become macros."""

# Like the script of the plain Verilog, but a synchronous reset goes into the data, since the gate replaces the enable.
TO_GATES = (
    "read_rtlil readout.il; delete t:$meminit_v2; hierarchy -check -top {top}; "
    "proc -norom; opt_expr; opt_merge; opt_clean; memory_collect {flops}; memory_map {flops}; opt_merge; opt_clean; "
    "opt_dff; dffunmap -srst-only; opt_expr; opt_dff -nosdff; opt_expr -mux_undef; wreduce; opt_merge; "
    "splitnets -driver eskin_classifier; opt_clean -purge; setattr -unset init w:*; write_json gated.json"
)
TO_VERILOG = (
    "read_json gated.json; read_verilog gate.v; hierarchy -top {top}; add -global_input {test} 1 {gate} {tested}; "
    "opt_clean; check -assert; write_verilog -noattr readout.v"
)


def gated(rtlil: str, top: str, synchronous_reset: bool) -> str:
    """Return Verilog with a clock gate for every block with a signal ``awake`` and for every large register enable.

    Modules with a memory get no gate inside. With a synchronous reset the clock runs in reset.
    """
    design = json.loads(yosys.run(TO_GATES.format(top=top, flops=FLOPS), rtlil, "gated.json"))
    stop_enables(design)
    stop_blocks(design, synchronous_reset)
    for module_name, module in design["modules"].items():
        named = [net["bits"] for net in module["netnames"].values() if not net["hide_name"]]
        for name, cell in module["cells"].items():
            if cell["type"] == GATE and cell["connections"]["enable"] not in named:
                net = {"hide_name": 0, "bits": cell["connections"]["enable"], "attributes": {}}
                module["netnames"][f"{name}_enable"] = net
        _keep_apart(module, (*SYNCHRONISERS.get(module_name, ()), *_mingled(module)))
    files = {"gated.json": json.dumps(design).encode(), "gate.v": STUB.encode()}
    script = TO_VERILOG.format(top=top, gate=GATE, test=TEST, tested=" ".join(_tested(design["modules"])))
    text = yosys.run(script, "", "readout.v", files)
    body = re.compile(rf"^module {GATE}\(.*?^endmodule\n\n?", re.MULTILINE | re.DOTALL)
    return body.sub("", yosys.tidy(text))


def _tested(modules: dict[str, Any]) -> set[str]:
    """Return the modules with a clock gate in the module or in one of its instances."""
    found: set[str] = {GATE}
    while more := {
        name
        for name, module in modules.items()
        if name not in found and any(cell["type"] in found for cell in module["cells"].values())
    }:
        found |= more
    return found - {GATE}


def _mingled(module: dict[str, Any]) -> list[str]:
    """Return the registers of which an output or a signal has some bits, beside other bits or in another order."""
    registers = {tuple(cell["connections"]["Q"]) for cell in module["cells"].values() if cell["type"] in REGISTERS}
    own = {name: net["bits"] for name, net in _own_nets(module).items() if tuple(net["bits"]) in registers}
    outputs = [port["bits"] for port in module["ports"].values() if port["direction"] == "output"]
    signals = [net["bits"] for net in _own_nets(module).values()]
    mingled = [bits for bits in outputs if list(bits) not in own.values()]
    mingled += [bits for bits in signals if not any(set(bits) <= set(register) for register in own.values())]
    return [name for name, bits in own.items() if any(not set(bits).isdisjoint(other) for other in mingled)]


def _own_nets(module: dict[str, Any]) -> dict[str, Any]:
    """Return the named signals of a module, except its ports."""
    return {
        name: net for name, net in module["netnames"].items() if not net["hide_name"] and name not in module["ports"]
    }


def _keep_apart(module: dict[str, Any], registers: Collection[str]) -> None:
    """Insert wires between registers and what shows their bits, so that each register keeps its name."""
    held = {bit for name in registers for bit in module["netnames"][name]["bits"]}
    outputs = {name: module["netnames"][name] for name, p in module["ports"].items() if p["direction"] == "output"}
    for name, net in (_own_nets(module) | outputs).items():
        if name in registers or (held.issuperset(net["bits"]) and name not in outputs):
            continue
        for place, bit in enumerate(net["bits"]):
            if bit in held:
                new = net["bits"][place] = highest_net(module) + 1
                if name in outputs:
                    module["ports"][name]["bits"][place] = new
                module["cells"][f"$shown{new}"] = cell_of("$_BUF_", {"A": bit, "Y": new})


def stop_enables(design: dict[str, Any]) -> int:
    """Replace every enable of ``FEWEST_FLOPS`` or more flip-flops in a JSON design by a clock gate; count the gates."""
    gates = 0
    for module in design["modules"].values():
        if any(cell["type"] == MEMORY for cell in module["cells"].values()):
            continue
        groups: dict[tuple[int, int, str], list[dict[str, Any]]] = {}
        for cell in module["cells"].values():
            if cell["type"] in ("$dffe", "$adffe"):
                pins = cell["connections"]
                key = (pins["CLK"][0], pins["EN"][0], cell["parameters"]["EN_POLARITY"])
                groups.setdefault(key, []).append(cell)
        for (clock, enable, polarity), flops in groups.items():
            if sum(len(cell["connections"]["Q"]) for cell in flops) < FEWEST_FLOPS or not int(polarity, 2):
                continue
            net = highest_net(module) + 1
            number = sum(cell["type"] == GATE for cell in module["cells"].values())
            for cell in flops:
                cell["type"] = {"$dffe": "$dff", "$adffe": "$adff"}[cell["type"]]
                cell["connections"]["CLK"] = [net]
                for table in (cell["connections"], cell["port_directions"]):
                    del table["EN"]
                del cell["parameters"]["EN_POLARITY"]
            pins = {"clk": clock, "enable": enable, "gated": net}
            module["cells"][f"gate_{number}"] = cell_of(GATE, pins, "gated") | {"hide_name": 0}
            module["netnames"][f"gated_{number}"] = {"hide_name": 0, "bits": [net], "attributes": {}}
            gates += 1
    return gates


def stop_blocks(design: dict[str, Any], synchronous_reset: bool) -> int:
    """Add a clock gate at the clock input of every block of a JSON design with a signal ``awake``; count these blocks.

    With a synchronous reset the clock runs in reset.
    """
    stopped = 0
    for module in design["modules"].values():
        if AWAKE not in module["netnames"] or "clk" not in module["ports"]:
            continue
        clock = module["ports"]["clk"]["bits"][0]
        awake = module["netnames"][AWAKE]["bits"][0]
        gated, enable = highest_net(module) + 1, highest_net(module) + 2
        for cell in module["cells"].values():
            if cell["type"] in LISTENS:
                continue
            for pin, bits in cell["connections"].items():
                if bits == [clock]:
                    cell["connections"][pin] = [gated]
        if synchronous_reset:
            pins = {"A": awake, "B": module["ports"]["rst"]["bits"][0], "Y": enable}
            module["cells"]["$awake_or_reset"] = cell_of("$_OR_", pins)
        else:
            enable = awake
        module["cells"]["block_gate"] = cell_of(GATE, {"clk": clock, "enable": enable, "gated": gated}, "gated")
        module["netnames"]["block_clk"] = {"hide_name": 0, "bits": [gated], "attributes": {}}
        stopped += 1
    return stopped
