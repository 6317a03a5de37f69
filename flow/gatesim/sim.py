"""Simulate a netlist with the co-simulation's scenarios and scans, and compare it with the model bit by bit."""

import dataclasses
import tempfile
from collections.abc import Callable
from pathlib import Path

from eskin.base.files import atomic_write
from eskin.cocotb_tests.runner import sim
from eskin.cocotb_tests.runner.process import Tally
from eskin.flow import programs
from eskin.flow.asic.structure import RESET_CLOCKS
from eskin.flow.asic.synthesis import synthesise
from eskin.flow.gatesim.flat_netlist import FlatNetlist, flatten
from eskin.flow.gatesim.models import models
from eskin.flow.liberty.library import Library, read
from eskin.model.config import ReadoutConfig

QUIET_CLOCKS = 16
"""Clocks after reset with all inputs at 0, in which flops and outputs must stay known."""


@dataclasses.dataclass(frozen=True)
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


@dataclasses.dataclass(frozen=True)
class Gates:
    """A netlist prepared for the simulator."""

    # netlist, cells: Verilog of netlist and library cells
    netlist: Path
    cells: Path
    unknown: Unknown


def prepare(config: ReadoutConfig, path: Path, folder: Path) -> Gates:
    """Synthesise a readout, write netlist and cell models into a folder, and check the reset."""
    library = read(path)
    made = synthesise(config, library)
    flat = flatten(made.text, made.top, library.content)
    written = made.write(folder)
    cells = folder / f"{made.top}.cells.v"
    with atomic_write(cells) as file:
        file.write(models(library, {cell.kind for cell in flat.cells}).encode())
    with tempfile.TemporaryDirectory() as scratch:
        return Gates(written, cells, from_reset(flat, library, Path(scratch)))


def play(
    plan: sim.Plan, gates: Gates, config: ReadoutConfig, repeat_options: str, on_stage: Callable[[str], None]
) -> Tally:
    """Simulate all scenarios and scans on a netlist; return the totals. ``repeat_options``: options of gatesim."""
    text = "\n".join(path.read_text() for path in (gates.netlist, gates.cells))
    return sim.play(
        dataclasses.replace(plan, text=text, repeat_options=repeat_options, command="gatesim"),
        config,
        lambda _: None,
        on_stage,
    )


def from_reset(netlist: FlatNetlist, library: Library, folder: Path) -> Unknown:
    """Return the flops whose values are unknown after a reset with all other inputs unknown."""
    kinds = {cell.kind for cell in netlist.cells}
    flops = [cell for cell in netlist.cells if library.cells[cell.kind].flop]
    outputs = [port.name for port in netlist.ports if port.direction == "output"]
    state = [
        next(f"dut.{cell.pins[pin]}" for pin in library.cells[cell.kind].outputs if cell.pins.get(pin))
        for cell in flops
    ]
    # The testbench prints the flops at the end of reset, and flops and outputs at the end of the run.
    values = {"top": netlist.top, "ports": netlist.ports, "state": state, "outputs": outputs}
    bench = programs.filled("reset.v", reset_clocks=RESET_CLOCKS, quiet_clocks=QUIET_CLOCKS, **values)
    texts = [models(library, kinds), netlist.verilog(), bench]
    in_reset, after, out = programs.icarus(texts, "bench", folder).split()
    places = [cell.place for cell in flops]
    left = [tuple(place for place, bit in zip(places, bits, strict=True) if bit == "x") for bits in (in_reset, after)]
    widths = [len(port.nets) for port in netlist.ports if port.direction == "output"]
    named = [name for name, width in zip(outputs, widths, strict=True) for _ in range(width)]
    return Unknown(
        len(flops), left[0], left[1], tuple(name for name, bit in zip(named, out, strict=True) if bit not in "01")
    )
