"""Prove that Verilog with clock gates is equivalent to the RTL."""

import json
from typing import Any

from eskin.flow.asic.compare import add, compare
from eskin.rtl import yosys
from eskin.rtl.gates.clock_gates import FLOPS, GATE, STUB, TEST
from eskin.rtl.verilog import Config, clock_and_reset, rtlil, top_block, verilog
from eskin.verify.proofs.delivered import DATA, MEMORY, SPELLED, UNDEFINED, Different

READ = {
    "gold": "read_rtlil readout.il; delete t:$meminit_v2; ",
    "gate": "read_verilog gated.v; read_verilog stub.v; blackbox {gate}; ",
}
FLAT = (
    "hierarchy -check -top {top}; setattr -mod -unset keep_hierarchy *; proc; opt_expr -mux_undef; opt_clean; "
    "memory_collect {flops}; memory_map {flops}; "
    "flatten; memory_collect; setattr -unset init w:*; delete t:$scopeinfo; techmap; dffunmap; simplemap; opt_clean; "
    "rename {top} {side}; write_json {side}.json; design -reset; "
)


def prove_gated(config: Config, text: str = "") -> int:
    """Return the number of flops, outputs and bits of memory pins of a clock-gated design proved equal to its RTLIL.

    A clock gate lets the rising edge through if its enable was high before. A flop behind clock gates is therefore
    proved as a flop that is enabled while all enables of these gates are high. ``test_enable`` is low. Nothing is
    assumed about which states can be reached. Each memory is cut: both designs read the same arbitrary word, and its
    read address and write pins must be equal.

    Parameters
    ----------
    text : str
        Verilog to be proved, by default as delivered.

    Raises
    ------
    Different
        If a point is not proved equal, a flop has another clock than ``clk``, or the Verilog has an undefined constant.
    """
    text = text or verilog(config, gated=True)
    if undefined := UNDEFINED.search(text):
        raise Different(f"the Verilog with clock gates has the undefined constant {undefined[0]}")
    top = top_block(config).module_name
    script = "".join((read + FLAT).format(top=top, side=side, gate=GATE, flops=FLOPS) for side, read in READ.items())
    files = {"gated.v": text.encode(), "stub.v": STUB.encode()}
    made = yosys.run_for(script, rtlil(config), [f"{side}.json" for side in READ], files)
    gold, gate = (json.loads(made[f"{side}.json"])["modules"][side] for side in READ)
    gold["netnames"] = {SPELLED.sub(r"\1\3_\2\4", name): net for name, net in gold["netnames"].items()}
    memories = []
    for module in (gold, gate):
        enables = _Enables(module, clock_and_reset(config)[0])
        enables.to_flops()
        memories.append(enables.cut_memories())
    if memories[0] != memories[1]:
        raise Different("with clock gates the memories are not those of the RTLIL")
    proved, differ = compare(gold, gate)
    if differ:
        raise Different(f"with clock gates not proved equal: {', '.join(differ[:5])}")
    return proved


class _Enables:
    """Logic added to a flat module in place of its clock gates, which are removed.

    ``root`` is the net of the clock input, and ``gates`` has the nets of clock and enable for each gated net.
    """

    def __init__(self, module: dict[str, Any], clock: str) -> None:
        self.module, self.cells = module, module["cells"]
        self.root = module["ports"][clock]["bits"][0]
        self.gates = {}
        for name, cell in list(self.cells.items()):
            if cell["type"] == GATE:
                pins = {pin: bits[0] for pin, bits in cell["connections"].items()}
                self.gates[pins["gated"]] = (pins["clk"], pins["enable"])
                del self.cells[name]
        for table in ("ports", "netnames"):
            module[table].pop(TEST, None)

    def of(self, clock: int) -> Any:
        """Return the common enable of the gates in front of a clock, None without a gate."""
        enable: Any = None
        while clock in self.gates:
            clock, own = self.gates[clock]
            enable = own if enable is None else add(self.module, "$_AND_", A=enable, B=own)
        if clock != self.root:
            raise Different("with clock gates a flop or memory has another clock than clk")
        return enable

    def to_flops(self) -> None:
        """Replace the gated clocks of all flops by enables."""
        for cell in list(self.cells.values()):
            if cell["type"].startswith("$_DFF_"):
                pins = cell["connections"]
                enable = self.of(pins["C"][0])
                pins["C"] = [self.root]
                if enable is not None:
                    pins["D"] = [add(self.module, "$_MUX_", A=pins["Q"][0], B=pins["D"][0], S=enable)]

    def cut_memories(self) -> dict[str, Any]:
        """Turn the pins of every memory into ports of the module; return the parameters of each memory.

        A gated clock becomes a part of the enable of every written bit.
        """
        found = {}
        for name, cell in list(self.cells.items()):
            if cell["type"] != MEMORY:
                continue
            del self.cells[name]
            pins, memory = cell["connections"], cell["parameters"]["MEMID"].removeprefix("\\")
            enable = self.of(pins["WR_CLK"][0])
            pins["WR_CLK"] = [self.root]
            if enable is not None:
                pins["WR_EN"] = [add(self.module, "$_AND_", A=bit, B=enable) for bit in pins["WR_EN"]]
            for pin in ("RD_ADDR", "RD_DATA", "WR_CLK", "WR_EN", "WR_ADDR", "WR_DATA"):
                direction = "input" if pin == "RD_DATA" else "output"
                self.module["ports"][f"{memory}.{pin}"] = {"direction": direction, "bits": pins[pin]}
            found[memory] = {key: value for key, value in cell["parameters"].items() if key not in DATA}
        return found
