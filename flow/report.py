"""Report of a netlist: ``out/asic/NAME/report.json``."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import atomic_write, make_folder, origin, write_json
from eskin.cocotb_tests.runner.reproduce import variables
from eskin.flow import programs
from eskin.flow.asic.constraints import sdc
from eskin.flow.asic.equivalence import Equivalence, design_of, prove
from eskin.flow.asic.structure import Structure, check
from eskin.flow.asic.synthesis import Config, Netlist, synthesise
from eskin.flow.asic.timing import Timing, analyse
from eskin.flow.liberty.library import Library, read
from eskin.flow.power.event_bench import Mismatch
from eskin.flow.power.measure import Disagreement
from eskin.flow.power.results import energies, why_not
from eskin.flow.wire import PITCH_UM
from eskin.model.config import ReadoutConfig
from eskin.rtl import yosys

SWITCHED_OFF = "simulation is switched off (POWER=0)"


@dataclass(frozen=True)
class Report:
    """All results of a synthesis run."""

    name: str
    netlist: Netlist
    cells: dict[str, Counter[str]]  # by block, then kind; all rows together are the block ``row``
    structure: Structure
    equivalence: Equivalence
    timing: dict[str, Timing]
    # further entries of the report, from simulation
    more: dict[str, Any] = field(default_factory=dict)
    unmeasured: str = SWITCHED_OFF  # reason why power is not measured

    def area_um2(self, block: str = "") -> float:
        """Return the cell area of a block, or of all blocks, without wires, clock tree and fill."""
        return self._sum(lambda cell: cell.area_um2, block)

    @property
    def leakage_w(self) -> float:
        """Leakage of all cells at the corner of the library, averaged over states."""
        return self._sum(lambda cell: cell.leakage_w)

    def _sum(self, value: Callable[[Any], float], block: str = "") -> float:
        known = self.netlist.library.cells
        chosen = [kinds for name, kinds in self.cells.items() if block in ("", name)]
        return sum(value(known[kind]) * number for kinds in chosen for kind, number in kinds.items())

    @property
    def problems(self) -> list[str]:
        """Problems of the netlist, one sentence each."""
        said = list(self.structure.problems)
        if not self.equivalence.holds:
            first = self.equivalence.unproved[:1] or ("nothing",)
            said.append(f"{self.equivalence.of - self.equivalence.proved} points differ from the RTL, {first[0]} first")
        for corner, timing in self.timing.items():
            said += [f"{corner}: {line}" for line in timing.complaints[:1]]
            if timing.setup_slack_s < 0:
                said.append(
                    f"{corner}: the setup slack is {timing.setup_slack_s * 1e9:.3g} ns at the clock of the readout"
                )
        if not self.unmeasured:
            events = self.more["gate_level_events"]
            if self.more.get("difference"):
                said.append(self.more["difference"])
            elif not events["netlist"] or events["netlist"] != events["rtl"]:
                said.append(f"the netlist sends {events['netlist']} events in simulation, the RTL {events['rtl']}")
        return said

    def closing_line(self) -> str:
        """Return the final message of ``make asic``."""
        taxels = readout_of(self.netlist.config).taxels
        fmax = self.timing["typical"].fmax_hz
        parts = [f"asic: {self.name}", f"{self.area_um2() / taxels:.0f} um2 per taxel", f"{fmax / 1e6:.1f} MHz"]
        if "energy_per_event_j" in self.more:
            parts.append(f"idle {self.more['idle_w_per_taxel'] * 1e9:.1f} nW per taxel")
            parts.append(f"{self.more['energy_per_event_j'] * 1e12:.2f} pJ per event")
        else:
            parts.append(f"power not measured: {self.unmeasured or 'a check of it failed'}")
        return ", ".join(parts)

    def to_dict(self, command: str) -> dict[str, Any]:
        """Return the report as a dictionary."""
        config, library = self.netlist.config, self.netlist.library
        taxels, area = readout_of(config).taxels, self.area_um2()
        every = sum(self.cells.values(), Counter[str]())
        gates, gate = "a latch and an AND: the library has no integrated clock gate", library.clock_gate
        if not self.netlist.gated:
            gates = "nothing: the library has neither a clock gate nor a latch, so every clock runs all the time"
        elif gate:
            gates = f"{gate.name} of the library"
        sequential = sum(library.cells[k].area_um2 * n for k, n in every.items() if k in library.flops)
        return {
            "name": self.name,
            **origin(command),
            "yosys": version(yosys.PACKAGE),
            "configuration": config.to_dict(),
            "library": library.path.name,
            "area_um2_per_taxel": area / taxels,
            "budget_um2_per_taxel": PITCH_UM**2,
            "fmax_hz": {corner: timing.fmax_hz for corner, timing in self.timing.items()},
            "leakage_w_per_taxel": self.leakage_w / taxels,
            **self.more,
            **({"power_not_measured": self.unmeasured} if self.unmeasured else {}),
            "flops": self.equivalence.flops,
            "gated_flops": self.equivalence.gated_flops,
            "equivalence": self.equivalence.to_dict(),
            "structure": self.structure.to_dict(),
            "clock_gates_from": gates,
            "cells": every.total(),
            "cells_per_taxel": every.total() / taxels,
            "sequential_area_share": sequential / area,
            "blocks": {
                block: {
                    "area_um2": self.area_um2(block),
                    "cells": kinds.total(),
                    "flops": sum(n for k, n in kinds.items() if k in library.flops),
                    "leakage_w": self._sum(lambda cell: cell.leakage_w, block),
                }
                for block, kinds in sorted(self.cells.items())
            },
            "cells_without_area": sorted(k for k in every if library.cells[k].area_um2 == 0),
            "timing": {corner: timing.to_dict() for corner, timing in self.timing.items()},
            "contains": "cells alone: no wires, no clock tree, no scan chain, no filling",
        }

    def write(self, out: Path, command: str) -> Path:
        """Write netlist, constraints and report into the folder of the run; return the path of the report."""
        folder = make_folder(out, self.name)
        self.netlist.write(folder)
        with atomic_write(folder / f"{self.netlist.top}.sdc") as file:
            file.write(sdc(self.netlist).encode())
        path = folder / "report.json"
        write_json(path, self.to_dict(command))
        return path


def readout_of(config: Config) -> ReadoutConfig:
    """Return the array configuration of a spiking or frame readout."""
    return config if isinstance(config, ReadoutConfig) else config.readout


def name_of(config: Config, library: Library) -> str:
    """Return the name of a run from readout, size, front end and library."""
    readout = readout_of(config)
    what = f"{readout.encoding}-{readout.frontend}" if config is readout else "frame"
    return f"{what}-{readout.rows}x{readout.columns}-{readout.resolution}b-{library.path.stem}"


def command_of(config: Config, corners: dict[str, Path], power: bool = True, delivered: bool = False) -> str:
    """Return the command line of a run, without default options."""
    readout = readout_of(config)
    words = ["make asic", *(["READOUT=frame"] if readout is not config else [])]
    for corner, path in corners.items():
        words.append(f"{'LIB' if corner == 'typical' else corner.upper()}={path.name}")
    words += variables(readout) + (variables(config) if readout is not config else [])
    words += [] if power else ["POWER=0"]
    words += ["FROM_VERILOG=1"] if delivered else []
    return " ".join(words)


def run(
    config: Config,
    corners: dict[str, Path],
    name: str,
    on_stage: Callable[[str], None],
    power: bool = True,
    delivered: bool = False,
) -> Report:
    """Return the results of synthesis, proof, structural checks, timing and power for a readout.

    ``corners``: Liberty files by corner; synthesis uses ``typical``.
    ``name``: folder of the run; empty for a name from the configuration.
    ``on_stage``: called with the name of each stage.
    ``power``: measure the power in simulation.
    ``delivered``: start from the Verilog of ``eskin verilog --clock-gates``, as a user's flow does.
    Raises InputError if a program is missing or a library lacks cells.
    """
    programs.check("sta")
    libraries = {corner: read(path) for corner, path in corners.items()}
    library = libraries["typical"]
    on_stage(f"netlist of {library.name}")
    made = synthesise(config, library, delivered=delivered)
    design = design_of(made)
    on_stage("rules")
    structure = check(made, design)
    on_stage("timing")
    constant = constant_outputs(made, design)
    timing = {corner: analyse(made, at, constant) for corner, at in libraries.items()}
    on_stage("proof")
    proof = prove(made, design)
    unmeasured, more = why_not(config) if power else SWITCHED_OFF, {}
    if not unmeasured:
        on_stage("simulation")
        more = measured(made)
    blocks = cells_by_block(made, design)
    name = name or name_of(config, library) + ("-from-verilog" if delivered else "")
    return Report(name, made, blocks, structure, proof, timing, more, unmeasured)


def measured(made: Netlist) -> dict[str, Any]:
    """Return the measured energies of a netlist, or its difference from the RTL."""
    try:
        return energies(made.config, made.text, made.library.path)
    except Mismatch as wrong:
        return {"gate_level_events": wrong.events, "difference": str(wrong)}
    except (Disagreement, InputError) as wrong:
        return {"gate_level_events": {"netlist": 0, "rtl": 0}, "difference": str(wrong)}


def constant_outputs(made: Netlist, design: dict[str, Any]) -> set[str]:
    """Return the output port bits driven by a constant or a tie cell."""
    module, ties = design["modules"][made.top], {tie[0] for level in (0, 1) if (tie := made.library.tie(level))}
    tied = {
        bit for c in module["cells"].values() if c["type"] in ties for bits in c["connections"].values() for bit in bits
    }
    found = set()
    for name, port in module["ports"].items():
        wide = len(port["bits"]) > 1
        for number, bit in enumerate(port["bits"]):
            if port["direction"] == "output" and (isinstance(bit, str) or bit in tied):
                found.add(f"{name}[{number}]" if wide else name)
    return found


def cells_by_block(made: Netlist, design: dict[str, Any]) -> dict[str, Counter[str]]:
    """Return the cell counts of a netlist by cell kind and block."""
    found: dict[str, Counter[str]] = {}
    for name, cell in design["modules"][made.top]["cells"].items():
        block = name.partition(".")[0].rstrip("0123456789").rstrip("_") if "." in name else "top"
        found.setdefault(block, Counter())[cell["type"]] += 1
    return found
