"""Quill, an example cell library for tests with few cells and unusual names."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Corner:
    """Corner of the library: supply, temperature, and factors of delays and leakage."""

    name: str
    voltage_v: float
    temperature_c: float
    delay: float
    leakage: float


TYPICAL = Corner("quill_typ", 1.2, 25, 1.0, 1.0)
SLOW = Corner("quill_slow", 1.08, 125, 1.6, 5.0)
FAST = Corner("quill_fast", 1.32, -40, 0.7, 0.5)

LOGIC = {
    "HOOT": ("!A", 2.0),
    "ECHO": ("A", 3.0),
    "NEITHER": ("!(A + B)", 3.0),
    "UNLESS": ("!(A B)", 3.0),
    "DIFFER": ("(A & !B) | (!A & B)", 6.0),
}
"""Function and area in um2; the functions are written in each of the ways that liberty knows."""

SLEWS, LOADS = (0.02, 0.5), (0.001, 0.1)


def library(corner: Corner = TYPICAL, without: tuple[str, ...] = ()) -> str:
    """Return the text of the Liberty file.

    ``without``: names of cells that are left out.
    """
    cells = {name: _logic(name, *what, corner) for name, what in LOGIC.items()}
    cells |= {name: _tie(name, level, corner) for name, level in (("NAUGHT", 0), ("UNITY", 1))}
    cells |= {"PERCH": _flop(corner), "NEST": _latch(corner), "SLUMBER": _gate(corner)}
    return (
        f"library ({corner.name}) {{\n"
        "  delay_model : table_lookup;\n"
        '  time_unit : "1ns"; voltage_unit : "1V"; current_unit : "1uA"; pulling_resistance_unit : "1kohm";\n'
        '  leakage_power_unit : "1pW"; capacitive_load_unit (1,pf);\n'
        f"  nom_process : 1; nom_voltage : {corner.voltage_v}; nom_temperature : {corner.temperature_c};\n"
        "  input_threshold_pct_rise : 50; input_threshold_pct_fall : 50;\n"
        "  output_threshold_pct_rise : 50; output_threshold_pct_fall : 50;\n"
        "  slew_lower_threshold_pct_rise : 20; slew_lower_threshold_pct_fall : 20;\n"
        "  slew_upper_threshold_pct_rise : 80; slew_upper_threshold_pct_fall : 80;\n"
        "  default_max_transition : 2.0; default_fanout_load : 1;\n"
        f"  operating_conditions ({corner.name}) {{ process : 1; voltage : {corner.voltage_v}; "
        f"temperature : {corner.temperature_c}; }}\n"
        f"  lu_table_template (delay) {{ variable_1 : input_net_transition; "
        f"variable_2 : total_output_net_capacitance; index_1 ({_row(SLEWS)}); index_2 ({_row(LOADS)}); }}\n"
        f"  lu_table_template (check) {{ variable_1 : related_pin_transition; variable_2 : constrained_pin_transition; "
        f"index_1 ({_row(SLEWS)}); index_2 ({_row(SLEWS)}); }}\n"
        f"  power_lut_template (energy) {{ variable_1 : input_transition_time; "
        f"variable_2 : total_output_net_capacitance; index_1 ({_row(SLEWS)}); index_2 ({_row(LOADS)}); }}\n"
        f"  power_lut_template (inner) {{ variable_1 : input_transition_time; index_1 ({_row(SLEWS)}); }}\n"
        + "".join(text for name, text in cells.items() if name not in without)
        + "}\n"
    )


def written(folder: Path, corner: Corner = TYPICAL, without: tuple[str, ...] = ()) -> Path:
    """Write the library into a folder and return the path of its file."""
    path = folder / f"{corner.name}.lib"
    path.write_text(library(corner, without))
    return path


def _row(values: tuple[float, ...]) -> str:
    return '"' + ", ".join(f"{value:g}" for value in values) + '"'


def _table(group: str, template: str, base: float, per_slew: float, per_load: float) -> str:
    rows = ", ".join(_row(tuple(base + per_slew * s + per_load * c for c in LOADS)) for s in SLEWS)
    return f"{group} ({template}) {{ values ({rows}); }} "


def _delays(corner: Corner, base: float) -> str:
    scale = corner.delay
    return "".join(
        _table(f"cell_{edge}", "delay", scale * base, 0.2, scale * 4.0)
        + _table(f"{edge}_transition", "delay", scale * base, 0.1, scale * 6.0)
        for edge in ("rise", "fall")
    )


def _energy(base: float) -> str:
    return (
        'internal_power () { related_pin : "%s"; '
        + "".join(_table(f"{edge}_power", "energy", base, 0.001, 0.0) for edge in ("rise", "fall"))
        + "} "
    )


def _inner(base: float) -> str:
    rows = _row(tuple(base + 0.001 * s for s in SLEWS))
    return (
        "internal_power () { " + "".join(f"{e}_power (inner) {{ values ({rows}); }} " for e in ("rise", "fall")) + "} "
    )


def _input(pin: str, capacitance: float, more: str = "") -> str:
    return f"    pin ({pin}) {{ direction : input; capacitance : {capacitance:g}; {more}}}\n"


def _cell(name: str, area: float, corner: Corner, body: str, more: str = "") -> str:
    leakage = 10 * area * corner.leakage
    return f"  cell ({name}) {{\n    area : {area:g}; cell_leakage_power : {leakage:g}; {more}\n{body}  }}\n"


def _logic(name: str, function: str, area: float, corner: Corner) -> str:
    pins = [pin for pin in "AB" if pin in function]
    sense = "non_unate" if name == "DIFFER" else "positive_unate" if name == "ECHO" else "negative_unate"
    arcs = "".join(
        f'timing () {{ related_pin : "{pin}"; timing_sense : {sense}; {_delays(corner, 0.03)}}} {_energy(0.002) % pin}'
        for pin in pins
    )
    output = f'    pin (Z) {{ direction : output; max_capacitance : 0.1; function : "{function}"; {arcs}}}\n'
    return _cell(name, area, corner, "".join(_input(pin, 0.002) for pin in pins) + output)


def _tie(name: str, level: int, corner: Corner) -> str:
    return _cell(name, 2.0, corner, f'    pin (Z) {{ direction : output; function : "{level}"; }}\n')


def _check(kind: str, related: str, limit: float) -> str:
    tables = "".join(_table(f"{edge}_constraint", "check", limit, 0.0, 0.0) for edge in ("rise", "fall"))
    return f'timing () {{ related_pin : "{related}"; timing_type : {kind}; {tables}}} '


def _output(corner: Corner, pin: str, function: str, clock: str, edge: str, more: str = "") -> str:
    arc = f'timing () {{ related_pin : "{clock}"; timing_type : {edge}; {_delays(corner, 0.1)}}} '
    power = _energy(0.01) % clock
    return (
        f'    pin ({pin}) {{ direction : output; max_capacitance : 0.1; function : "{function}"; {arc}{more}{power}}}\n'
    )


def _flop(corner: Corner) -> str:
    checks = _check("setup_rising", "BEAT", 0.08) + _check("hold_rising", "BEAT", -0.01)
    wake = _check("recovery_rising", "BEAT", 0.05) + _check("removal_rising", "BEAT", 0.02)
    cleared = (
        'timing () { related_pin : "WIPE"; timing_sense : positive_unate; timing_type : clear; '
        + _table("cell_fall", "delay", 0.1, 0.1, 4.0)
        + _table("fall_transition", "delay", 0.1, 0.1, 6.0)
        + "} "
    )
    body = '    ff (STATE, INVERSE) { clocked_on : "BEAT"; next_state : "NEXT"; clear : "!WIPE"; }\n'
    body += _input("BEAT", 0.003, "clock : true; " + _inner(0.008)) + _input("NEXT", 0.002, checks)
    body += _input("WIPE", 0.002, wake) + _output(corner, "HELD", "STATE", "BEAT", "rising_edge", cleared)
    return _cell("PERCH", 20.0, corner, body)


def _latch(corner: Corner) -> str:
    body = '    latch (STATE, INVERSE) { enable : "OPEN"; data_in : "NEXT"; }\n'
    arc = f'timing () {{ related_pin : "NEXT"; timing_sense : positive_unate; {_delays(corner, 0.08)}}} '
    body += _input("OPEN", 0.003, "clock : true; " + _inner(0.004))
    body += _input("NEXT", 0.002, _check("setup_falling", "OPEN", 0.05) + _check("hold_falling", "OPEN", 0.01))
    return _cell("NEST", 12.0, corner, body + _output(corner, "HELD", "STATE", "OPEN", "rising_edge", arc))


def _gate(corner: Corner) -> str:
    body = (
        '    statetable ("BEAT WANTED TRIAL", "inner") { table : "L L L : - : L, L L H : - : H, L H L : - : H, '
        'L H H : - : H, H - - : - : N"; }\n'
        '    pin (inner) { direction : internal; internal_node : "inner"; }\n'
    )
    checks = _check("setup_rising", "BEAT", 0.08) + _check("hold_rising", "BEAT", 0.01)
    body += _input("BEAT", 0.004, "clock : true; clock_gate_clock_pin : true; " + _inner(0.006))
    body += _input("WANTED", 0.002, "clock_gate_enable_pin : true; " + checks)
    body += _input("TRIAL", 0.002, "clock_gate_test_pin : true; " + checks)
    arc = f'timing () {{ related_pin : "BEAT"; timing_sense : positive_unate; {_delays(corner, 0.06)}}} '
    body += (
        '    pin (BEATS) { direction : output; clock_gate_out_pin : true; state_function : "BEAT * inner"; '
        f"max_capacitance : 0.1; {arc}{_energy(0.01) % 'BEAT'}}}\n"
    )
    return _cell(
        "SLUMBER", 15.0, corner, body, 'clock_gating_integrated_cell : "latch_posedge_precontrol"; dont_use : true;'
    )
