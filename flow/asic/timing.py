"""Static timing of a netlist by OpenSTA: highest clock frequency, critical path, unconstrained endpoints."""

import re
from collections.abc import Collection
from dataclasses import dataclass

from eskin.base.errors import InputError
from eskin.flow import programs
from eskin.flow.asic.constraints import sdc
from eskin.flow.asic.synthesis import Netlist
from eskin.flow.liberty.library import Library

SLACK = re.compile(r"(-?\d+\.\d+) +slack")
STAGE = re.compile(r"^ +\S+ +(\d+\.\d+) +[v^] (\S+)/\S+ \((\w+)\)$", re.MULTILINE)


@dataclass(frozen=True)
class Timing:
    """The timing of a netlist at one corner, by OpenSTA."""

    library: Library
    fmax_hz: float  # highest clock at which no setup time is missed
    # setup_slack_s, hold_slack_s: worst, at the clock of the configuration
    setup_slack_s: float
    hold_slack_s: float
    depth: int  # cells on the critical path, flops apart
    path: tuple[tuple[str, str, float], ...]  # instance, cell and arrival in s of every stage of the critical path
    complaints: tuple[str, ...]  # what ``check_setup`` finds unconstrained; empty if nothing

    def to_dict(self) -> dict[str, object]:
        """Return the timing as an entry of the report."""
        return {
            "library": self.library.path.name,
            "voltage_v": self.library.voltage_v,
            "temperature_c": self.library.temperature_c,
            "fmax_hz": self.fmax_hz,
            "setup_slack_s": self.setup_slack_s,
            "hold_slack_s": self.hold_slack_s,
            "logic_depth": self.depth,
            "critical_path": [
                {"instance": name, "cell": cell, "arrival_s": round(time, 15)} for name, cell, time in self.path
            ],
            "check_setup": list(self.complaints),
        }


def analyse(netlist: Netlist, library: Library, constant: Collection[str] = ()) -> Timing:
    """Return the timing of a netlist at the corner of a library; ``constant`` names output bits that never change."""
    programs.check("sta")
    used = set(re.findall(r"^  (\w+) (?:\\\S+|\w+) +\(", netlist.text, re.MULTILINE))
    if missing := sorted(used - set(library.cells)):
        raise InputError(f"the cell library {library.path} has no cell {missing[0]}; give corners of one library")
    for name in sorted(used):
        library.cells[name].check()  # OpenSTA gives no clear message for a wrong table
    script = programs.filled("timing.tcl", top=netlist.top, own=1e9 / netlist.config.clock_hz)
    files: dict[str, str | bytes] = {"cells.lib": library.content, "netlist.v": netlist.text}
    said = programs.opensta(script, files | {"constraints.sdc": sdc(netlist, "$period")})
    found = said.values
    if {"PERIOD", "PATH", "OWN", "SETUP"} - set(found):
        raise RuntimeError(f"OpenSTA failed on {netlist.top}: {said.failed()}")
    setup, hold = map(float, found["OWN"].split())
    period, left = map(float, found["PERIOD"].split())
    if left < 0:
        raise RuntimeError(f"{netlist.top} violates setup times at every clock: slack {left} ns at period {period} ns")
    worst = min(found["PATH"].split("Startpoint: ")[1:], key=lambda text: float(SLACK.findall(text)[-1]))
    stages = tuple((name, cell, float(time) * 1e-9) for time, name, cell in STAGE.findall(worst))
    logic = [cell for _, cell, _ in stages if not library.cells[cell].flop]
    complaints = _complaints(found["SETUP"], constant)
    return Timing(library, 1e9 / period, setup * 1e-9, hold * 1e-9, len(logic), stages, complaints)


def _complaints(said: str, constant: Collection[str]) -> tuple[str, ...]:
    """Return the warnings of ``check_setup``, except those about constant port bits."""
    kept: list[str] = []
    for line in (line for line in said.splitlines() if line.strip()):
        if not line.startswith(" ") and kept and not kept[-1].startswith(" "):
            kept.pop()
        if line.strip() not in constant:
            kept.append(line)
    if kept and not kept[-1].startswith(" "):
        kept.pop()
    return tuple(line.strip() for line in kept)
