"""Prove that Verilog with clock gates is equivalent to the RTL."""

from __future__ import annotations

import json
import re
from typing import Any

from eskin.flow.asic.compare import compare
from eskin.rtl import yosys
from eskin.rtl.gates.cells import cell_of, highest_net
from eskin.rtl.gates.clock_gates import FLOPS, GATE, STUB, TEST
from eskin.rtl.verilog import Config, rtlil, top_block, verilog
from eskin.verify.proofs.delivered import DATA, MEMORY, Different

READ = {
    "gold": "read_rtlil readout.il; delete t:$meminit_v2; ",
    "gate": "read_verilog gated.v; read_verilog stub.v; blackbox {gate}; ",
}
FLAT = (
    "hierarchy -check -top {top}; proc; opt_expr -mux_undef; opt_clean; memory_collect {flops}; memory_map {flops}; "
    "flatten; memory_collect; setattr -unset init w:*; delete t:$scopeinfo; techmap; dffunmap; simplemap; opt_clean; "
    "rename {top} {side}; write_json {side}.json; design -reset; "
)
SPELLED = re.compile(r"\\?\$(signal)\$(\d+)$|\b(memory)\[(\d+)\]$")
"""Names of the RTLIL that the Verilog spells with an underscore: signals without a name, and words of flops."""


def prove_gated(config: Config, text: str = "") -> int:
    """Return the number of flops and outputs of a clock-gated design proved equal to its RTLIL.

    A clock gate lets the rising edge through where its enable was high before: a flop behind it is a flop with that
    enable, all those in its way. ``test_enable`` is low. Nothing is assumed about which states can be reached. A memory
    may read any word; its addresses, its enables and the words written must be equal.

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
    script = "".join((read + FLAT).format(top=top, side=side, gate=GATE, flops=FLOPS) for side, read in READ.items())
    files = {"gated.v": (text or verilog(config, gated=True)).encode(), "stub.v": STUB.encode()}
    made = yosys.run_for(script, rtlil(config), [f"{side}.json" for side in READ], files)
    gold, gate = (json.loads(made[f"{side}.json"])["modules"][side] for side in READ)
    gold["netnames"] = {SPELLED.sub(r"\1\3_\2\4", name): net for name, net in gold["netnames"].items()}
    memories = []
    for module in (gold, gate):
        enables = _Enables(module)
        enables.to_flops()
        memories.append(enables.cut_memories(module))
    if memories[0] != memories[1]:
        raise Different("with clock gates the memories are not those of the RTLIL")
    proved, differ = compare(gold, gate)
    if differ:
        raise Different(f"with clock gates not proved equal: {', '.join(differ[:5])}")
    return proved


class _Enables:
    """Logic added to a flat module in place of its clock gates, which are removed.

    Attributes
    ----------
    gates : dict of int to (int, int)
        Nets of the clock and the enable of the gate that drives a net.
    """

    def __init__(self, module: dict[str, Any]) -> None:
        self.cells, self.last = module["cells"], highest_net(module)
        self.gates = {}
        for name, cell in list(self.cells.items()):
            if cell["type"] == GATE:
                pins = {pin: bits[0] for pin, bits in cell["connections"].items()}
                self.gates[pins["gated"]] = (pins["clk"], pins["enable"])
                del self.cells[name]
        for table in ("ports", "netnames"):
            module[table].pop(TEST, None)

    def add(self, kind: str, **inputs: Any) -> int:
        """Add a logic gate and return its output net."""
        self.last += 1
        self.cells[f"$enable{self.last}"] = cell_of(kind, inputs | {"Y": self.last})
        return self.last

    def of(self, clock: int) -> tuple[int, Any]:
        """Return the net that drives the gates in front of a clock, and their common enable, None without a gate."""
        enable: Any = None
        while clock in self.gates:
            clock, own = self.gates[clock]
            enable = own if enable is None else self.add("$_AND_", A=enable, B=own)
        return clock, enable

    def to_flops(self) -> None:
        """Replace the gated clocks of all flops by enables."""
        for cell in list(self.cells.values()):
            if cell["type"].startswith("$_DFF_"):
                pins = cell["connections"]
                clock, enable = self.of(pins["C"][0])
                pins["C"] = [clock]
                if enable is not None:
                    pins["D"] = [self.add("$_MUX_", A=pins["Q"][0], B=pins["D"][0], S=enable)]

    def cut_memories(self, module: dict[str, Any]) -> dict[str, Any]:
        """Turn the pins of every memory into ports of the module; return the parameters of each memory.

        A gated clock becomes a part of the enable of every written bit.
        """
        found = {}
        for name, cell in list(self.cells.items()):
            if cell["type"] != MEMORY:
                continue
            del self.cells[name]
            pins, memory = cell["connections"], cell["parameters"]["MEMID"].removeprefix("\\")
            pins["WR_CLK"][0], enable = self.of(pins["WR_CLK"][0])
            if enable is not None:
                pins["WR_EN"] = [self.add("$_AND_", A=bit, B=enable) for bit in pins["WR_EN"]]
            for pin in ("RD_ADDR", "RD_DATA", "WR_CLK", "WR_EN", "WR_ADDR", "WR_DATA"):
                direction = "input" if pin == "RD_DATA" else "output"
                module["ports"][f"{memory}.{pin}"] = {"direction": direction, "bits": pins[pin]}
            found[memory] = {key: value for key, value in cell["parameters"].items() if key not in DATA}
        return found
