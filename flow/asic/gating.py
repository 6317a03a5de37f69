"""Clock gate module for a cell library: an integrated clock gate, or a latch with an AND gate."""

from __future__ import annotations

from eskin.flow.liberty.library import Library
from eskin.rtl.gates.clock_gates import GATE, TEST


def gate_module(library: Library) -> str:
    """Return a Verilog clock gate with test enable; empty if the library has no suitable cells.

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
