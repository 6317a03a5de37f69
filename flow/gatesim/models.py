"""Verilog models of library cells, generated from the functions in the liberty file, with optional fixed delay."""

from eskin.base.errors import InputError
from eskin.flow import programs
from eskin.flow.liberty.library import Cell, Library


def models(library: Library, kinds: set[str], delay_ns: float = 0.0) -> str:
    """Return the Verilog models of given cells, with a delay of ``delay_ns`` in steps of 0.1 ns.

    A flop whose clock turns unknown loses its state, unless it would keep it. So a netlist that wakes up only by the
    optimism of a simulator stays unknown. Clock gates take no time, as in a balanced clock tree.
    """
    cells = []
    for cell in library.used(kinds):
        outputs = [] if cell.gate_kind else [cell.pins[name] for name in cell.outputs]
        if bare := [pin for pin in outputs if not pin.function]:
            raise InputError(
                f"the cell library does not define the function of {cell.name} at {bare[0].name}; keep the cell out of "
                f"netlists"
            )
        gate = _clock_gate(cell) if cell.gate_kind else None
        cells.append((cell, None if gate else cell.memory, gate, outputs))
    return programs.filled("cells.v", cells=cells, delay_ns=delay_ns)


def _clock_gate(cell: Cell) -> dict[str, str]:
    """Return the expressions of a clock gate, which is a latch and an AND gate or an OR gate."""
    kind, roles = cell.gate_kind, {pin.role: name for name, pin in cell.pins.items()}
    clock, enable, test, output = (roles.get(role, "") for role in ("clock", "enable", "test", "out"))
    if not kind.startswith(("latch_posedge", "latch_negedge")) or not (clock and enable and output):
        raise InputError(f"the clock gate {cell.name} has the unknown kind {kind!r}; use the kind latch_posedge")
    opens, gated = (f"~{clock}", "&") if kind.startswith("latch_posedge") else (clock, "|")
    held = "held_" if gated == "&" else "~held_"
    before = f"({enable} | {test})" if test and "postcontrol" not in kind else enable
    behind = f"({held} | {test})" if test and "postcontrol" in kind and gated == "&" else held
    return {"clock": clock, "output": output, "opens": opens, "gated": gated, "before": before, "behind": behind}
