"""Read synthesis reports for the power model (docs/guide/power.md)."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from eskin.base.configuration import Configuration
from eskin.base.errors import InputError
from eskin.base.files import read_json
from eskin.model.config import MAX_SIDE
from eskin.power.readouts import Readout

Leak = Literal["analog", "digital"]


MOST = {
    "clock_hz": 1e12,
    "area_um2": 1e12,
    "leakage_w": 1e3,
    "clock_power_w_per_hz": 1e-6,
    "energy_per_event_j": 1e-3,
    "energy_per_lone_event_j": 1e-3,
    "supply_v": 1e3,
}
"""Largest numbers that a report may have: beyond them a unit is wrong."""


@dataclass(frozen=True, kw_only=True)
class SynthesisReport(Configuration):
    """Area and power of the digital logic of one readout, without pads."""

    readout: Readout
    # rows, columns: leakage and clock power are scaled to other arrays by the number of taxels
    rows: int
    columns: int
    clock_hz: float
    area_um2: float  # cells only
    leakage_w: float
    clock_power_w_per_hz: float  # power of clock tree and flops while nothing happens, per hertz of clock (J per clock)
    energy_per_event_j: float  # of an event in a stream of events; for ``frame``, of a sample
    # of a single event; 0 for the same energy. The share of busy clocks interpolates between both energies
    energy_per_lone_event_j: float = 0.0
    process: str = ""  # technology, for the tables
    supply_v: float = 1.0  # supply of the report; powers are not scaled
    # place of the N-LCS leak: the published analog filter, or the netlist, for which the power model charges a DAC
    # instead of the filter
    leak: Leak = "analog"

    def __post_init__(self) -> None:
        self._check_types()
        for name in ("rows", "columns"):
            self._check_range(name, 1, MAX_SIDE)
        for name, most in MOST.items():
            self._check_range(name, 0.0, most)
            if not getattr(self, name) and name in ("clock_hz", "supply_v"):
                raise InputError(f"{name} must be positive, not 0")

    def power_w(self, taxels: int, event_rate_hz: Any) -> Any:
        """Return the digital power in watts, in the shape of the event rate.

        ``event_rate_hz``: events (or samples) per second of an array of ``taxels``. One event takes a clock, so the
        clock is at least the event rate.
        """
        import numpy as np

        clock_hz = np.maximum(self.clock_hz, event_rate_hz)
        scale = taxels / (self.rows * self.columns)
        alone = self.energy_per_lone_event_j or self.energy_per_event_j
        # An interpolation in which more events never need less power.
        more = alone / self.energy_per_event_j - 1 if self.energy_per_event_j else 0.0
        energy_j = alone / (1 + more * event_rate_hz / clock_hz)
        return scale * (self.leakage_w + self.clock_power_w_per_hz * clock_hz) + energy_j * event_rate_hz

    @classmethod
    def from_dict(cls, values: Any) -> SynthesisReport:
        """Return the report for a dictionary; unknown fields are ignored."""
        if not isinstance(values, dict):
            raise InputError(f"a synthesis report must be a JSON object, not {type(values).__name__}")
        known = dataclasses.fields(cls)
        required = [f.name for f in known if f.default is dataclasses.MISSING]
        if missing := [name for name in required if name not in values]:
            raise InputError(f"a synthesis report needs the field {missing[0]!r}; docs/guide/power.md lists all fields")
        return cls(**{f.name: values[f.name] for f in known if f.name in values})

    @classmethod
    def load(cls, path: Path) -> SynthesisReport:
        """Return the report from a JSON file."""
        values = read_json(path, "the synthesis report")
        try:
            return cls.from_dict(values)
        except InputError as error:
            raise InputError(f"synthesis report {path}: {error}") from None


def load_reports(paths: list[Path]) -> dict[str, SynthesisReport]:
    """Return the reports from files by readout; raise an error for two reports of one readout."""
    reports: dict[str, SynthesisReport] = {}
    for path in paths:
        report = SynthesisReport.load(path)
        if report.readout in reports:
            raise InputError(
                f"{path} is a second synthesis report of readout {report.readout}; give one report for each readout"
            )
        reports[report.readout] = report
    return reports
