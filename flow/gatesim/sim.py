"""Simulate a netlist with the co-simulation's scenarios and scans, and compare it with the model bit by bit."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Callable
from pathlib import Path

from eskin.base.files import atomic_write
from eskin.cocotb_tests.runner import sim
from eskin.cocotb_tests.runner.process import Tally
from eskin.flow.asic.synthesis import synthesise
from eskin.flow.gatesim.flat_netlist import flatten
from eskin.flow.gatesim.models import models
from eskin.flow.gatesim.reset_check import Unknown, from_reset
from eskin.flow.liberty.library import read
from eskin.model.config import ReadoutConfig


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


def play(plan: sim.Plan, gates: Gates, config: ReadoutConfig, again: str, on_stage: Callable[[str], None]) -> Tally:
    """Simulate all scenarios and scans on a netlist; return the totals. ``again``: options of gatesim."""
    text = "\n".join(path.read_text() for path in (gates.netlist, gates.cells))
    return sim.play(
        dataclasses.replace(plan, text=text, again=again, command="gatesim"), config, lambda _: None, on_stage
    )
