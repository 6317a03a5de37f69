"""Datasheet section on area, power and highest clock frequency, from the report of ``make asic``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import read_json
from eskin.flow.datasheet.sheet import si, table
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig

POWERS = {
    "leakage_w_per_taxel": ("leakage per taxel", "W"),
    "idle_w_per_taxel": ("idle power per taxel, with a running clock", "W"),
    "energy_per_event_j": ("energy per event, with an event in every clock", "J"),
    "energy_per_lone_event_j": ("energy of a lone event", "J"),
}
OF_FRAMES = {name: POWERS[name] for name in ("leakage_w_per_taxel", "idle_w_per_taxel")} | {
    "energy_per_event_j": ("energy per sample, for whole frames", "J")
}
OF_WINDOWS = {
    "closing_w_per_taxel": ("power per taxel while its window closes", "W"),
    "energy_per_closed_window_j": ("energy until a window is closed, in addition to the idle power", "J"),
}
ABSENT = (
    "Area, power and highest clock need a cell library. `make asic LIB=typ.lib` leaves `out/asic/NAME/report.json`, "
    "and `make verilog REPORT=out/asic/NAME/report.json` of the same configuration puts its numbers here."
)


def load_report(path: Path, config: ReadoutConfig | FrameConfig) -> dict[str, Any]:
    """Return the netlist report that belongs to a configuration."""
    content: dict[str, Any] = read_json(path, "the report", dict)
    needed = ("configuration", "library", "area_um2_per_taxel", "fmax_hz", "flops", "gated_flops")
    if absent := [name for name in needed if name not in content]:
        raise InputError(f"{path} lacks {absent[0]} and is not a report of make asic; give report.json of make asic")
    stored, wanted = content["configuration"], config.to_dict()
    for name in dict.fromkeys([*wanted, *stored]):
        if stored.get(name) != wanted.get(name):
            raise InputError(
                f"the report {path} has {name} = {stored.get(name)}, not {wanted.get(name)}; give the report of "
                f"this configuration"
            )
    return content


def of_netlist(report: dict[str, Any] | None) -> str:
    """Return the datasheet section for a netlist report."""
    if report is None:
        return ABSENT
    area = report["area_um2_per_taxel"]
    rows = [
        (
            "area per taxel, with its share of arbiter and link",
            "not known to the library" if area is None else f"{area:.5g} um2",
        )
    ]
    rows += [(f"highest clock, {corner}", si(value, "Hz")) for corner, value in report["fmax_hz"].items()]
    rows.append(("flops, and flops on a gated clock", f"{report['flops']}, {report['gated_flops']}"))
    powers = OF_FRAMES if "word_bits" in report["configuration"] else POWERS
    for name, (what, unit) in (powers | {name: said for name, said in OF_WINDOWS.items() if name in report}).items():
        value = report.get(name)
        rows.append((what, "not in the report" if value is None else si(value, unit)))
    if proof := report.get("equivalence"):
        rows.append(("netlist equal to the RTL", f"{proof['proved']} of {proof['of']} points proved"))
    if run := report.get("gate_level_events"):
        rows.append(("events in simulation: of the netlist, of the RTL", f"{run['netlist']}, {run['rtl']}"))
    source = f"Library {report['library']}, commit {report.get('commit', 'unknown')}, {report.get('date', 'no date')}."
    contains = report.get("contains")
    return source + (f" They contain: {contains}." if contains else "") + "\n\n" + table(" | ", rows)
