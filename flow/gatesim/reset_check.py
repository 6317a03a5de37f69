"""Check that reset alone brings every flop of a netlist into a known state."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from eskin.flow.asic.structure import RESET_CLOCKS
from eskin.flow.gatesim import icarus
from eskin.flow.gatesim.flat_netlist import FlatNetlist
from eskin.flow.gatesim.models import models
from eskin.flow.liberty.library import Library

QUIET_CLOCKS = 16
"""Clocks after reset, with all inputs at 0, in which no flop and no output may turn unknown."""


@dataclass(frozen=True)
class Unknown:
    """Flops and outputs with unknown values after reset."""

    flops: int
    # in_reset, after: flops that are unknown at the end of reset, and at the end of the run
    in_reset: tuple[str, ...]
    after: tuple[str, ...]
    outputs: tuple[str, ...]  # output ports that are unknown at the end of all

    @property
    def clean(self) -> bool:
        """True if the netlist has flops, and all flops and outputs are known."""
        return self.flops > 0 and not (self.in_reset or self.after or self.outputs)


def from_reset(netlist: FlatNetlist, library: Library, folder: Path) -> Unknown:
    """Return the flops whose values are unknown after a reset with all other inputs unknown."""
    kinds = {cell.kind for cell in netlist.cells}
    flops = [cell for cell in netlist.cells if library.cells[cell.kind].flop]
    outputs = [port.name for port in netlist.ports if port.direction == "output"]
    state = [
        next(f"dut.{cell.pins[pin]}" for pin in library.cells[cell.kind].outputs if cell.pins.get(pin))
        for cell in flops
    ]
    texts = [models(library, kinds), netlist.verilog(), _bench(netlist, state, outputs)]
    in_reset, after, out = icarus.run(texts, "bench", folder).split()
    places = [cell.place for cell in flops]
    left = [tuple(place for place, bit in zip(places, bits, strict=True) if bit == "x") for bits in (in_reset, after)]
    widths = [len(port.nets) for port in netlist.ports if port.direction == "output"]
    named = [name for name, width in zip(outputs, widths, strict=True) for _ in range(width)]
    return Unknown(
        len(flops), left[0], left[1], tuple(name for name, bit in zip(named, out, strict=True) if bit not in "01")
    )


def _bench(netlist: FlatNetlist, state: list[str], outputs: list[str]) -> str:
    """Return a testbench that prints the flops at the end of reset, and flops and outputs at the end of the run."""
    clocks = {"reset_clocks": RESET_CLOCKS, "quiet_clocks": QUIET_CLOCKS}
    values = {"top": netlist.top, "ports": netlist.ports, "state": state, "outputs": outputs}
    return icarus.TEMPLATES.get_template("reset.v").render(values | clocks)
