"""Report of a layout: attempts and check results."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from eskin.base.files import make_folder, origin, write_json
from eskin.base.units import counted
from eskin.cocotb_tests.runner.reproduce import variables
from eskin.flow.layout import cells
from eskin.flow.layout.checks import Comparison, Electrical, Rules
from eskin.flow.layout.circuit import Circuit
from eskin.flow.layout.environment import REQUIREMENTS
from eskin.flow.layout.tree import ClockTree
from eskin.model.config import NO_LOGIC, ReadoutConfig


@dataclass(frozen=True)
class Try:
    """Result of one routing attempt with a given area margin."""

    margin: float
    problem: str  # reason why the layout is rejected; empty if accepted
    width_um: float = 0.0
    height_um: float = 0.0
    # None if a wire is open, or the netlist is another
    rules: Rules | None = None
    tree: ClockTree | None = None
    electrical: Electrical | None = None


@dataclass(frozen=True)
class Report:
    """A layout and its check results."""

    name: str
    config: ReadoutConfig
    circuit: Circuit = field(repr=False)
    cell_area_um2: float
    # proved, of: compare points (flops and bits of outputs) that are proved equal to the RTL, and all compare points
    proved: int
    of: int
    tries: tuple[Try, ...]  # the last attempt is the layout
    comparison: Comparison | None  # None without a comparison
    seconds: dict[str, float]

    @property
    def problems(self) -> list[str]:
        """Problems of the layout, one sentence each."""
        said = []
        if self.proved != self.of:
            said.append(f"{self.of - self.proved} of {self.of} points of the netlist differ from the RTL")
        if self.tries[-1].problem:
            said += [f"margin {one.margin:.2f}: {one.problem}" for one in self.tries]
        if self.comparison and not self.comparison.equal:
            first = self.comparison.differ[:1] or ("no net",)
            said.append(f"the layout's netlist differs from the cells': {first[0]} first")
        return said

    def closing_line(self) -> str:
        """Return the final message of ``make layout``."""
        last = self.tries[-1]
        violations = sum(len(found.violations) for found in (last.rules, last.electrical) if found)
        parts = [f"layout: {self.name}", f"{len(self.circuit.cells)} cells"]
        if last.rules:
            parts += [f"{last.width_um:.0f} x {last.height_um:.0f} um", f"{violations} violations"]
        else:
            parts.append("not routed")
        if last.tree and last.electrical:
            found = last.electrical
            parts.append(f"{last.tree.buffers} clock buffers")
            parts.append(f"antennas at most {100 * found.antenna_share:.0f} % of the limit")
            if found.inputs:
                parts.append(f"diodes needed outside at {counted(len(found.inputs), 'input')}")
            parts.append(f"metals at most {100 * max(found.density.values()):.0f} % dense")
            parts.append(f"wires at most {found.largest_ohm:.0f} ohm")
        if self.comparison:
            parts.append("netlist equal" if self.comparison.equal else "netlist differs")
        else:
            parts.append("netlist not compared")
        return ", ".join(parts)

    def to_dict(self, command: str) -> dict[str, Any]:
        """Return the report as a dictionary."""
        last = self.tries[-1]
        area = last.width_um * last.height_um
        return {
            "name": self.name,
            **origin(command),
            "packages": [line for line in REQUIREMENTS.read_text().splitlines() if line[:1] not in "#"],
            "configuration": self.config.to_dict(),
            "cells": len(self.circuit.cells),
            "kinds": dict(sorted(self.circuit.kinds.items())),
            "cells_left_out": list(cells.LEFT_OUT),
            "ports": len(self.circuit.ports),
            "wires": len(self.circuit.wires),
            "cell_area_um2": round(self.cell_area_um2, 2),
            "width_um": round(last.width_um, 2),
            "height_um": round(last.height_um, 2),
            "utilisation": round(self.cell_area_um2 / area, 3) if area else None,
            "equivalence": {"proved": self.proved, "of": self.of},
            "margins": [{"margin": one.margin, "problem": one.problem} for one in self.tries],
            "rules": last.rules and asdict(last.rules),
            "clock_tree": last.tree and asdict(last.tree),
            "electrical": last.electrical and asdict(last.electrical),
            "comparison": self.comparison and asdict(self.comparison),
            "problems": self.problems,
            "seconds": self.seconds,
        }


def name_of(config: ReadoutConfig) -> str:
    """Return the name of a run from encoding, front end and size."""
    return f"{config.encoding}-{config.frontend}-{config.rows}x{config.columns}-{config.resolution}b"


def command_of(config: ReadoutConfig, compare: bool) -> str:
    """Return the command line of a run: its size, and the other options that differ from the defaults."""
    size = {f"ROWS={config.rows}": None, f"COLUMNS={config.columns}": None}
    words = size | dict.fromkeys(variables(config, NO_LOGIC))
    return " ".join(["make layout", *words, *([] if compare else ["COMPARE=0"])])


def write(report: Report, out: Path, command: str) -> Path:
    """Write report.json beside the layout; return its path."""
    path = make_folder(out, report.name) / "report.json"
    write_json(path, report.to_dict(command))
    return path
