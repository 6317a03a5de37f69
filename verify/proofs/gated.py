"""Prove that Verilog with clock gates is equivalent to the RTL."""

from __future__ import annotations

import json
from typing import Any

from eskin.flow.asic.compare import compare
from eskin.flow.asic.equivalence import GOLD
from eskin.rtl import yosys
from eskin.rtl.gates.cells import cell_of, highest_net
from eskin.rtl.gates.clock_gates import GATE, STUB, TEST
from eskin.rtl.verilog import Config, rtlil, top_block, verilog
from eskin.verify.proofs.delivered import Different

READ = (
    "read_verilog gated.v; read_verilog stub.v; blackbox {gate}; hierarchy -check -top {top}; proc; flatten; "
    "setattr -unset init w:*; delete t:$scopeinfo; techmap; dffunmap; simplemap; opt_clean; rename {top} gate; "
    "write_json gate.json"
)


def prove_gated(config: Config, text: str = "") -> int:
    """Return the number of flops and outputs of a clock-gated readout proved equal to its RTLIL.

    A clock gate lets the rising edge through where its enable was high before: a flop behind it is a flop with that
    enable, all those in its way. ``test_enable`` is low. Nothing is assumed about which states can be reached.

    Parameters
    ----------
    config : Config
    text : str
        Verilog to be proved; that which is delivered by default.

    Raises
    ------
    Different
        If a point is not proved equal.
    """
    top = top_block(config).module_name
    gold = json.loads(yosys.run(GOLD.format(top=top), rtlil(config), "gold.json"))["modules"]["gold"]
    files = {"gated.v": (text or verilog(config, gated=True)).encode(), "stub.v": STUB.encode()}
    made = yosys.run(READ.format(top=top, gate=GATE), "", "gate.json", files)
    gate = json.loads(made)["modules"]["gate"]
    _to_enables(gate)
    proved, differ = compare(gold, gate)
    if differ:
        raise Different(f"with clock gates not proved equal: {', '.join(differ[:5])}")
    return proved


def _to_enables(module: dict[str, Any]) -> None:
    """Replace the clock gates of a flat module by enables, in place."""
    gates = {}
    for name, cell in list(module["cells"].items()):
        if cell["type"] == GATE:
            pins = {pin: bits[0] for pin, bits in cell["connections"].items()}
            gates[pins["gated"]] = (pins["clk"], pins["enable"])
            del module["cells"][name]
    for table in ("ports", "netnames"):
        module[table].pop(TEST, None)
    last = highest_net(module)

    def add(kind: str, **inputs: Any) -> int:
        nonlocal last
        last += 1
        module["cells"][f"$enable{last}"] = cell_of(kind, inputs | {"Y": last})
        return last

    for cell in list(module["cells"].values()):
        pins = cell["connections"]
        if not cell["type"].startswith("$_DFF_"):
            continue
        enable: Any = None
        while pins["C"][0] in gates:
            clock, own = gates[pins["C"][0]]
            enable = own if enable is None else add("$_AND_", A=enable, B=own)
            pins["C"] = [clock]
        if enable is not None:
            pins["D"] = [add("$_MUX_", A=pins["Q"][0], B=pins["D"][0], S=enable)]
