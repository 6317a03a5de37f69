"""Clock gates: one of the library, or one built of a latch, and the gates that stop whole blocks."""

from __future__ import annotations

from typing import Any

from eskin.flow.asic.design import cell_of, highest_net
from eskin.flow.liberty.library import Library

GATE = "eskin_clock_gate"
TEST = "test_enable"
"""Port of the top, tied low in operation: high, it lets every clock through, as a scan chain needs."""

AWAKE = "awake"
"""Signal of a block in the RTL: low in a clock at whose end no register in it changes, links apart."""

LISTENS = ("eskin_link", "eskin_host")
"""Blocks whose clock never stops: they listen to what comes without a clock."""


def gate_module(library: Library) -> str:
    """Return the Verilog module of a clock gate with test enable; empty where the library has nothing to build one.

    An integrated gate of the library is taken, else one is built of a latch that is open while the clock is low.
    """
    head = f"module {GATE}(input clk, input enable, input {TEST}, output gated);\n"
    cell = library.clock_gate
    if cell and cell.gate:
        pins = cell.gate
        enable = "enable" if pins.test else f"enable | {TEST}"
        test = f", .{pins.test}({TEST})" if pins.test else ""
        body = f"  {cell.name} gate(.{pins.clock}(clk), .{pins.enable}({enable}){test}, .{pins.gated}(gated));\n"
        return head + body + "endmodule\n"
    latch = library.gate_latch
    if not (latch and latch.latch and latch.latch.outputs):
        return ""
    pins_of = latch.latch
    output, inverted = next(iter(pins_of.outputs.items()))
    opened = "~clk" if pins_of.rising else "clk"
    return (
        f"{head}  wire kept;\n"
        f"  {latch.name} latch(.{pins_of.data}(enable | {TEST}), .{pins_of.clock}({opened}), .{output}(kept));\n"
        f"  assign gated = clk & {'~' if inverted else ''}kept;\nendmodule\n"
    )


def stop_blocks(design: dict[str, Any], top: str, synchronous_reset: bool, root: bool = True) -> int:
    """Put a clock gate at the root of the clock of every block that says when it is awake.

    Parameters
    ----------
    design : dict
        A design of Yosys, as ``write_json`` gives it; changed in place.
    top : str
    synchronous_reset : bool
        The clock must run in reset.
    root : bool
        Whether the top is stopped as a whole, too: its enable comes from all of the array, which takes long in a large
        one.

    Returns
    -------
    int
        Blocks with such a gate, each kind counted once.
    """
    stopped = 0
    for name, module in design["modules"].items():
        if AWAKE not in module["netnames"] or "clk" not in module["ports"] or (name == top and not root):
            continue
        clock = module["ports"]["clk"]["bits"][0]
        awake = module["netnames"][AWAKE]["bits"][0]
        gated, enable = highest_net(module) + 1, highest_net(module) + 2
        for cell in module["cells"].values():
            if name == top and cell["type"] in LISTENS:
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
