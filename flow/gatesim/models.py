"""Verilog models of library cells, generated from the functions in the liberty file, with optional fixed delay."""

from __future__ import annotations

from eskin.base.errors import InputError
from eskin.flow.liberty.boolean import verilog_of
from eskin.flow.liberty.library import Cell, Library, Memory


def models(library: Library, kinds: set[str], delay_ns: float = 0.0) -> str:
    """Return the Verilog models of given cells, with a delay of ``delay_ns`` in steps of 0.1 ns.

    A flop whose clock turns unknown loses its state, unless it would keep it. So a netlist that wakes up only by the
    optimism of a simulator stays unknown. Clock gates take no time, as in a balanced clock tree.
    """
    precision = "100ps" if delay_ns else "1ns"
    lines = [f"`timescale 1ns / {precision}"]
    for cell in library.used(kinds):
        if cell.gate_kind:
            body = _clock_gate(cell)
        else:
            body = (_memory(cell.memory) if cell.memory else []) + _outputs(cell, delay_ns)
        ports = [f"input {pin}" for pin in cell.inputs] + [f"output {pin}" for pin in cell.outputs]
        lines += [f"module {cell.name} ({', '.join(ports)});", *(f"  {line}" for line in body), "endmodule", ""]
    return "\n".join(lines)


def _outputs(cell: Cell, delay_ns: float) -> list[str]:
    """Return the Verilog assignments of the outputs."""
    lines = []
    after = f"#{delay_ns:.1f} " if delay_ns else ""
    for name in cell.outputs:
        pin = cell.pins[name]
        if not pin.function:
            raise InputError(
                f"the cell library does not define the function of {cell.name} at {name}; keep the cell out of netlists"
            )
        off = f"{verilog_of(pin.three_state)} ? 1'bz : " if pin.three_state else ""
        lines.append(f"assign {after}{name} = {off}{verilog_of(pin.function)};")
    return lines


def _memory(memory: Memory) -> list[str]:
    """Return the Verilog model of a flop or a latch."""
    state, low = memory.state, "1'b0"
    clear, preset = (verilog_of(text) if text else low for text in (memory.clear, memory.preset))
    when, stored = verilog_of(memory.when), verilog_of(memory.stored)
    both = low if memory.both != "H" else "1'b1"
    head = [f"reg {state};", f"wire {memory.inverse} = ~{state};"]
    if memory.is_flop:
        return [
            *head,
            f"wire clock_ = {when}, next_ = {stored}, clear_ = {clear}, preset_ = {preset};",
            "reg before_;",
            "always @(clock_ or clear_ or preset_) begin",
            f"  if (clear_ === 1'b1 && preset_ === 1'b1) {state} <= {both};",
            f"  else if (clear_ === 1'b1) {state} <= 1'b0;",
            f"  else if (preset_ === 1'b1) {state} <= 1'b1;",
            f"  else if (clear_ === 1'bx && {state} !== 1'b0) {state} <= 1'bx;",
            f"  else if (preset_ === 1'bx && {state} !== 1'b1) {state} <= 1'bx;",
            f"  else if (before_ === 1'b0 && clock_ === 1'b1) {state} <= next_;",
            f"  else if (before_ !== clock_ && (before_ === 1'bx || clock_ === 1'bx) && before_ !== 1'b1 "
            f"&& clock_ !== 1'b0 && {state} !== next_) {state} <= 1'bx;",
            "  before_ = clock_;",
            "end",
        ]
    return [
        *head,
        f"wire open_ = {when}, data_ = {stored}, clear_ = {clear}, preset_ = {preset};",
        "always @(open_ or data_ or clear_ or preset_)",
        f"  if (clear_ === 1'b1) {state} = 1'b0;",
        f"  else if (preset_ === 1'b1) {state} = 1'b1;",
        f"  else if (open_ === 1'b1) {state} = data_;",
        f"  else if ((open_ === 1'bx || clear_ === 1'bx || preset_ === 1'bx) && {state} !== data_) {state} = 1'bx;",
    ]


def _clock_gate(cell: Cell) -> list[str]:
    """Return the Verilog model of a clock gate: a latch and an AND gate."""
    kind, roles = cell.gate_kind, {pin.role: name for name, pin in cell.pins.items()}
    clock, enable, test, output = (roles.get(role, "") for role in ("clock", "enable", "test", "out"))
    if not kind.startswith(("latch_posedge", "latch_negedge")) or not (clock and enable and output):
        raise InputError(f"the clock gate {cell.name} has the unknown kind {kind!r}; use the kind latch_posedge")
    rests, gated = (f"~{clock}", "&") if kind.startswith("latch_posedge") else (clock, "|")
    held = "held_" if gated == "&" else "~held_"
    before = f"({enable} | {test})" if test and "postcontrol" not in kind else enable
    behind = f"({held} | {test})" if test and "postcontrol" in kind and gated == "&" else held
    return [
        "reg held_;",
        f"wire open_ = {rests}, data_ = {before};",
        "always @(open_ or data_)",
        "  if (open_ === 1'b1) held_ = data_;",
        "  else if (open_ === 1'bx && held_ !== data_) held_ = 1'bx;",
        f"assign {output} = {clock} {gated} {behind};",
    ]
