"""Compute the power of a clock-gated netlist with two methods, in several scenarios."""

import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eskin.flow.gatesim.flat_netlist import FlatNetlist, flatten
from eskin.flow.gatesim.models import models
from eskin.flow.liberty.library import Library
from eskin.flow.power import frame_bench
from eskin.flow.power.activity import Activity
from eskin.flow.power.event_bench import play
from eskin.flow.power.liberty_power import CellActivity, LibertyPower
from eskin.flow.power.opensta_power import OpenstaPower
from eskin.flow.power.scenarios import (
    CLOSING,
    IDLE,
    LONE,
    SATURATED,
    TEXTURE,
    closing_ticks,
    comparisons,
    scenarios,
)
from eskin.flow.wire import FARAD_PER_UM, WITHIN_UM
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig

MAX_APART = 0.05
"""Largest allowed difference of the two methods, as a share of the power of all cells."""

APART = "apart"
"""Text that replaces the results with wires if the two methods differ too much."""

TAXEL = re.compile(r"\brow_(\d+)\b(?:.*?\btaxel_(\d+)\b)?")


class Disagreement(Exception):  # a result of the measurement, not a defect of this program
    """Raised if the results of the two methods differ by too much."""


@dataclass(frozen=True)
class ScenarioPower:
    """Power of a netlist in one scenario."""

    # clocks, events: in the window; for frames, samples
    clocks: int
    events: int
    # by tables of the library: inside cells, in their loads, leakage by state, and in the nets of the inputs
    internal_w: float
    switching_w: float
    leakage_w: float
    inputs_w: float
    by_opensta_w: float  # power of all cells
    agreement: float  # ``by_opensta_w`` / power by tables, both with leakage averaged over all states
    blocks: dict[str, float]  # power of the cells of every block

    @property
    def power_w(self) -> float:
        """Total power in watts."""
        return self.internal_w + self.switching_w + self.leakage_w + self.inputs_w


@dataclass
class PowerMeter:
    """A netlist whose power is computed with both methods."""

    tables: LibertyPower
    opensta: OpenstaPower
    clock_hz: float
    most_apart: float = MAX_APART

    def measure(
        self, name: str, activity: Activity, events: int, uses: dict[str, CellActivity] | None = None
    ) -> ScenarioPower:
        """Return the power of the netlist for recorded net activity."""
        own = self.tables.power_w(activity, self.clock_hz, uses)
        internal, switching, leakage = (sum(power[part] for power in own.values()) for part in range(3))
        other = sum(sum(power) for power in self.opensta.power_w(activity, self.clock_hz).values())
        agreement = other / (internal + switching + self.tables.stateless_w())
        if abs(agreement - 1) > self.most_apart:
            raise Disagreement(
                f"{name}: OpenSTA and the library's tables differ by {100 * (agreement - 1):+.1f} %, "
                f"{1e6 * other:.4g} and {1e6 * (internal + switching + self.tables.stateless_w()):.4g} uW; "
                f"at most {100 * self.most_apart:.0f} % are allowed"
            )
        blocks = dict.fromkeys(sorted({block_of(cell.place) for cell in self.tables.netlist.cells}), 0.0)
        for cell in self.tables.netlist.cells:
            blocks[block_of(cell.place)] += sum(own[cell.name])
        inputs = self.tables.inputs_w(activity, self.clock_hz)
        return ScenarioPower(activity.clocks, events, internal, switching, leakage, inputs, other, agreement, blocks)


def measure(
    config: ReadoutConfig | FrameConfig, text: str, library: Library, pitches_um: tuple[float, ...] = (0.0,)
) -> list[dict[str, Any]]:
    """Return the power of a netlist for every wire estimate.

    ``text``: gated netlist, Verilog.
    ``pitches_um``: taxel pitches for the wire estimates; 0 for no wires. A result with wires contains only the pitch
    and the reason if the two methods differ too much.
    Raises Mismatch if netlist and model differ.
    Raises Disagreement if the two methods differ too much without wires.
    """
    top = "eskin_frame_readout" if isinstance(config, FrameConfig) else "eskin_readout"
    flat = flatten(text, top, library.content)
    cells = models(library, {cell.kind for cell in flat.cells})
    with tempfile.TemporaryDirectory() as name:
        played, due, asked = _played(config, flat, cells, Path(name))
    results: list[dict[str, Any]] = []
    uses: dict[str, dict[str, CellActivity]] = {}
    for pitch in pitches_um:
        wires = wires_f(flat, config.rows, config.columns, pitch)
        meter = PowerMeter(LibertyPower(flat, library, wires), OpenstaPower(flat, library, wires), config.clock_hz)
        uses = uses or {name: meter.tables.uses(activity) for name, (activity, _) in played.items()}
        try:
            found = {
                name: meter.measure(name, activity, events, uses[name]) for name, (activity, events) in played.items()
            }
        except Disagreement as apart:
            if not pitch:
                raise
            results.append({"pitch_um": pitch, APART: str(apart)})
            continue
        sent = {"netlist": sum(stretch.events for stretch in found.values()), "rtl": due}
        results.append(_summary(config, flat, library, pitch, found) | asked | {"gate_level_events": sent})
    return results


def _played(
    config: ReadoutConfig | FrameConfig, flat: FlatNetlist, cells: str, folder: Path
) -> tuple[dict[str, tuple[Activity, int]], int, dict[str, dict[str, int]]]:
    """Return net activity and events of each scenario, the number of expected events, and any comparisons."""
    if isinstance(config, FrameConfig):
        seen = frame_bench.play(config, flat, cells, folder)
        return seen, sum(samples for _, samples in seen.values()), {}
    chosen, asked = scenarios(config), {}
    if config.frontend == "analog":  # for the energy of the comparators outside
        asked = {"comparisons": {s.name: comparisons(config, s) for s in chosen}}
    played = {s.name: play(s, config, flat, cells, folder) for s in chosen}
    return played, sum(s.events_inside for s in chosen), asked


def _summary(
    config: ReadoutConfig | FrameConfig,
    flat: FlatNetlist,
    library: Library,
    pitch_um: float,
    found: dict[str, ScenarioPower],
) -> dict[str, Any]:
    """Return all results as a dictionary for JSON."""
    idle, taxels = found[IDLE], config.taxels

    def energy(name: str, without: str = IDLE) -> float | None:
        """Return the energy in joules that an event adds to a quiet readout."""
        if name not in found:
            return None
        stretch = found[name]
        return (stretch.power_w - found[without].power_w) * stretch.clocks / config.clock_hz / stretch.events

    readout = config.readout if isinstance(config, FrameConfig) else config
    busy = TEXTURE if isinstance(config, FrameConfig) else SATURATED
    energies = {
        "energy_per_event_j": energy(busy),
        "energy_per_lone_event_j": energy(LONE, CLOSING if CLOSING in found else IDLE),  # few events: windows close
        "energy_per_texture_event_j": energy(TEXTURE),
    }
    closing = {}
    if isinstance(config, ReadoutConfig) and CLOSING in found:
        power = found[CLOSING].power_w / taxels
        joules = (power - idle.power_w / taxels) * closing_ticks(config) / config.sample_rate_hz
        closing = {"closing_w_per_taxel": power, "energy_per_closed_window_j": joules}
    return {
        "readout": "frame" if isinstance(config, FrameConfig) else config.encoding,
        "frontend": "" if isinstance(config, FrameConfig) else config.frontend,
        "rows": config.rows,
        "columns": config.columns,
        "resolution": readout.resolution,
        "clock_hz": config.clock_hz,
        "area_um2": sum(library.cells[cell.kind].area_um2 for cell in flat.cells),
        "process": library.name,
        "supply_v": library.voltage_v,
        "pitch_um": pitch_um,
        **({"leak": "digital"} if readout.encoder.leaks else {}),
        "leakage_w": idle.leakage_w,
        "clock_power_w_per_hz": (idle.power_w - idle.leakage_w) / config.clock_hz,
        **{name: value for name, value in energies.items() if value is not None},
        "idle_w_per_taxel": idle.power_w / taxels,
        **closing,
        "leakage_w_per_taxel": idle.leakage_w / taxels,
        "scenarios": {name: vars(stretch) | {"power_w": stretch.power_w} for name, stretch in found.items()},
    }


GLITCH_DELAY_NS, GLITCH_PARTS = 0.1, 40
"""Delay of every cell, and samples of the nets per half clock: one sample per cell delay."""


def glitches(config: ReadoutConfig, text: str, library: Library) -> dict[str, dict[str, float]]:
    """Return the energy of an event in joules, simulated with zero cell delay and with 0.1 ns cell delay.

    The energies are those of the library's tables, without wires, of each scenario with events; ``idle_w`` is the power
    of the idle readout. The difference is what glitches cost, if every cell is as fast as every other.
    """
    flat = flatten(text, "eskin_readout", library.content)
    kinds = {cell.kind for cell in flat.cells}
    tables = LibertyPower(flat, library, {})
    found: dict[str, dict[str, float]] = {}
    for name, delay, parts in (("no_delay", 0.0, 1), ("delay", GLITCH_DELAY_NS, GLITCH_PARTS)):
        powers: dict[str, float] = {}
        for scenario in scenarios(config):
            with tempfile.TemporaryDirectory() as folder:
                activity, events = play(scenario, config, flat, models(library, kinds, delay), Path(folder), parts)
            spent = sum(map(sum, tables.power_w(activity, config.clock_hz).values()))
            powers[scenario.name] = float(spent) + tables.inputs_w(activity, config.clock_hz)
            if events:
                more = powers[scenario.name] - powers[CLOSING if scenario.name == LONE and CLOSING in powers else IDLE]
                found.setdefault(name, {})[scenario.name] = more * scenario.clocks / config.clock_hz / events
        found[name]["idle_w"] = powers[IDLE]
    return found


def wires_f(netlist: FlatNetlist, rows: int, columns: int, pitch_um: float) -> dict[str, float]:
    """Return the wire capacitance of every net, estimated from the taxel pitch; empty for a pitch of 0.

    A net within a block has ``WITHIN_UM`` for every pin. A net between blocks also spans half the box around its
    blocks. A row lies along the array with its taxels spread over it. Everything else, and the ports, are at the middle
    of the left edge.
    """
    if not pitch_um:
        return {}
    pins: dict[str, list[str]] = {}
    for cell in netlist.cells:
        for net in cell.pins.values():
            pins.setdefault(net, []).append(block_of(cell.place))
    for port in netlist.ports:
        for net in port.nets:
            pins.setdefault(net, []).append("port")

    def spot(block: str) -> tuple[float, float]:
        """Return the position of a block in units of the pitch."""
        found = TAXEL.match(block)
        if not found:
            return 0.0, rows / 2
        return (float(found[2]) if found[2] else (columns - 1) / 2) + 0.5, float(found[1]) + 0.5

    def length_um(places: list[str]) -> float:
        x, y = np.array([spot(block) for block in set(places)]).T
        return WITHIN_UM * len(places) + pitch_um * float(np.ptp(x) + np.ptp(y))

    return {net: FARAD_PER_UM * length_um(places) for net, places in pins.items() if not net.startswith("1'b")}


def block_of(place: str) -> str:
    """Return the block of a cell: its taxel or row, else the first part of its name, else the top.

    Examples
    --------
    >>> block_of("row_3.taxel_1._12_"), block_of("row_3._7_"), block_of("arbiter._1_"), block_of("_9_")
    ('row_3.taxel_1', 'row_3', 'arbiter', 'top')
    """
    parts = place.split(".")
    if len(parts) == 1:
        return "top"
    return ".".join(parts[:2]) if len(parts) > 2 and parts[1].startswith("taxel_") else parts[0]
