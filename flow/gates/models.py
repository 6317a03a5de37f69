"""Functional Verilog of library cells, made from what the liberty says they do; nothing in them takes time."""

from __future__ import annotations

from flow.asic.library import text_of
from flow.gates.liberty import CellLibrary, LibraryCell, verilog_of
from model.errors import InputError


def models(library: CellLibrary, kinds: set[str]) -> str:
    """Return the Verilog of some cells.

    A flop whose clock turns unknown loses its state, unless it would keep it: a netlist that only a simulator's
    optimism wakes up stays unknown here.

    Parameters
    ----------
    library : CellLibrary
    kinds : set of str
        Names of the cells.

    Raises
    ------
    InputError
        If the library has no such cell, or does not say what it does.
    """
    return "`timescale 1ns / 1ns\n" + "\n".join(map(model_of, library.used(kinds)))


def model_of(cell: LibraryCell) -> str:
    """Return the Verilog module of a cell."""
    inputs, outputs = cell.of_direction("input"), cell.of_direction("output")
    if cell.clock_gate:
        body = _clock_gate(cell)
    elif cell.state is not None:
        body = _flop(cell) if cell.is_flop else _latch(cell)
        body += _outputs(cell)
    else:
        body = _outputs(cell)
    ports = [f"input {pin}" for pin in inputs] + [f"output {pin}" for pin in outputs]
    return "\n".join([f"module {cell.name} ({', '.join(ports)});", *(f"  {line}" for line in body), "endmodule", ""])


def _outputs(cell: LibraryCell) -> list[str]:
    """Return the assignments of the outputs, by their functions."""
    lines = []
    for name in cell.of_direction("output"):
        function, off = text_of(cell.pins[name]["function"]), text_of(cell.pins[name]["three_state"])
        if not function:
            raise InputError(f"the cell library does not say what {cell.name} does at {name}; keep it out of netlists")
        value = verilog_of(function)
        lines.append(
            f"assign {name} = {f'{verilog_of(off)} ? 1`bz : {value}'.replace('`', chr(39)) if off else value};"
        )
    return lines


def _state_names(cell: LibraryCell) -> tuple[str, str]:
    names = [text_of(name) for name in cell.state.args]
    return names[0], names[1] if len(names) > 1 else f"{names[0]}_bar"


def _overrides(cell: LibraryCell) -> tuple[str, str]:
    """Return clear and preset of a flop or latch as Verilog, 0 where it has none."""
    clear, preset = (text_of(cell.state[name]) for name in ("clear", "preset"))
    return verilog_of(clear) if clear else "1'b0", verilog_of(preset) if preset else "1'b0"


def _flop(cell: LibraryCell) -> list[str]:
    """Return a flop: next state at the rising edge, lost at an unknown clock; clear and preset at once."""
    state, inverted = _state_names(cell)
    clear, preset = _overrides(cell)
    following, clock = verilog_of(text_of(cell.state["next_state"])), verilog_of(text_of(cell.state["clocked_on"]))
    both = "1'b0" if text_of(cell.state["clear_preset_var1"]) != "H" else "1'b1"
    return [
        f"reg {state};",
        f"wire {inverted} = ~{state};",
        f"wire clock_ = {clock}, next_ = {following}, clear_ = {clear}, preset_ = {preset};",
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


def _latch(cell: LibraryCell) -> list[str]:
    """Return a latch, open while it is enabled."""
    state, inverted = _state_names(cell)
    clear, preset = _overrides(cell)
    data, enable = verilog_of(text_of(cell.state["data_in"])), verilog_of(text_of(cell.state["enable"]))
    return [
        f"reg {state};",
        f"wire {inverted} = ~{state};",
        f"wire open_ = {enable}, data_ = {data}, clear_ = {clear}, preset_ = {preset};",
        "always @(open_ or data_ or clear_ or preset_)",
        f"  if (clear_ === 1'b1) {state} = 1'b0;",
        f"  else if (preset_ === 1'b1) {state} = 1'b1;",
        f"  else if (open_ === 1'b1) {state} = data_;",
        f"  else if ((open_ === 1'bx || clear_ === 1'bx || preset_ === 1'bx) && {state} !== data_) {state} = 1'bx;",
    ]


def _clock_gate(cell: LibraryCell) -> list[str]:
    """Return a clock gate: a latch that is open while the clock rests, and the gate behind it."""
    kind = cell.clock_gate
    clock, enable, test, output = (cell.marked(f"clock_gate_{role}_pin") for role in ("clock", "enable", "test", "out"))
    if not kind.startswith(("latch_posedge", "latch_negedge")) or not (clock and enable and output):
        raise InputError(f"the clock gate {cell.name} is a {kind!r}, which is not known; use a latch_posedge")
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
