"""Measure comparator and DAC in ngspice: energy, offset, noise, delay, kick-back, linearity and leakage."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from eskin.analog.circuit import FrontEnd, Taxel
from eskin.analog.decision import FINE_S, FINE_STEPS, compare, decide, fine, waveform
from eskin.analog.models import CORNERS, sizes
from eskin.analog.ngspice import simulate
from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig

Data = dict[str, Any]

MISMATCH_V_UM = {"nfet": 3.356e-3, "pfet": 5.856e-3}
"""Deviation of the threshold voltage of a transistor of 1 um^2: vth0_slope of nfet_01v8 and pfet_01v8 in SkyWater's
kit, of which the package holds the nominal models alone. The offset of a pair is larger by sqrt(2)."""

CAPACITOR_MISMATCH = 0.0085
"""Relative deviation of a metal fringe capacitor of 1 fF (Tripathi and Murmann, IEEE TCAS-I 61(8), 2014)."""

BOLTZMANN_J_PER_K, GAMMA = 1.380649e-23, 1.0
"""GAMMA: thermal noise of a short transistor is 4 k T GAMMA gm."""

CYCLE_S, FIRE_S = 20e-9, 2e-9
"""Period of the comparator in these measurements, and the time of its rising edge."""

REACH_V, HALVINGS = 40e-3, 9
"""Range of the search for an offset, and its steps; their last interval is 0.16 mV wide."""

COMPARATOR = re.compile(r"^[ \t]*\.subckt\s+comparator\s.*?^[ \t]*\.ends", re.I | re.M | re.S)


def clocked(f: FrontEnd, cycles: int = 1, cycle_s: float = CYCLE_S) -> list[str]:
    """Return the clock of a comparator and its short steps; ckn is active low, with a buffer."""
    levels = []
    for cycle in range(cycles):
        begin = cycle * cycle_s + FIRE_S
        levels += [(begin, 0.0), (begin + cycle_s / 2, f.supply_v)]
    return [f"Vck ckn 0 {waveform(f.supply_v, levels)}", "Xck ckn ck vdd 0 buffer", fine(FIRE_S)]


def comparator(f: FrontEnd, number: int | str = "", cell: str = "comparator", state: int = 0) -> list[str]:
    """Return a comparator with inputs p and n and loaded outputs, and the state of its latch."""
    n, supply_v = number, f.supply_v
    return [
        f"Xc{n} ck p{n} n{n} op{n} on{n} vdd 0 {cell}",
        f"Co{n} op{n} 0 2f",
        f"Cn{n} on{n} 0 2f",
        f".nodeset v(op{n})={supply_v * state:g} v(on{n})={supply_v * (1 - state):g}",
    ]


def inputs(f: FrontEnd, input_v: float, number: int | str = "") -> list[str]:
    """Return the sources of the inputs of a comparator: n at half the supply, and p above it."""
    half = f.supply_v / 2
    return [f"Vp{number} p{number} 0 {half + input_v:.7g}", f"Vn{number} n{number} 0 {half:g}"]


def answers(f: FrontEnd, lines: list[str], count: int, step: str) -> NDArray[np.bool_]:
    """Return which of several clocked comparators, numbered from 0, answer with high."""
    end = FIRE_S + 4e-9
    measures = [f"o{number} find v(op{number}) at={end:g}" for number in range(count)]
    found = simulate(f.circuit(*lines, f".tran {step} {1.01 * end:g}"), measures)
    return np.array([found[f"o{number}"] > f.supply_v / 2 for number in range(count)])


def check(f: FrontEnd) -> None:
    """Refuse a comparator that lacks a size, answers wrongly, or is too slow for the other measurements."""
    for line in subcircuit(f.cells):
        if line.strip().lower().startswith("m") and not sizes(line):
            raise InputError(f"a transistor needs a model, then w and l, such as w=0.42u l=0.15u, not: {line.strip()}")
    lines = clocked(f)
    for number, volts in enumerate((0.1, -0.1)):  # each holds the other answer before
        lines += [*comparator(f, number, state=number), *inputs(f, volts, number)]
    found = tuple("high" if high else "low" for high in answers(f, lines, 2, "1n"))
    if found != ("high", "low"):
        raise InputError(
            "4 ns after the rising edge of clk, outp must be high if inp is 0.1 V above inn, and low if inp is 0.1 V "
            f"below; outp is {found[0]}, and {found[1]}"
        )
    (delay_s,) = delays(f, (1e-3,))["delays_s"]
    if delay_s is None or delay_s > FINE_S * FINE_STEPS:
        raise InputError(f"with 1 mV between inp and inn, outp must change within {FINE_S * FINE_STEPS * 1e9:g} ns")


def energy(f: FrontEnd, input_v: float = 10e-3) -> Data:
    """Return the energy of a decision with its strobe's buffer: with an equal answer before, and with another."""
    found = {}
    for name, state in (("same_j", 1), ("flip_j", 0)):
        lines = [*clocked(f), *comparator(f, state=state), *inputs(f, input_v), f".tran 1n {CYCLE_S:g}"]
        charge = simulate(f.circuit(*lines), [f"charge integ i(vdd) from=0.5n to={CYCLE_S:g}"])["charge"]
        found[name] = -f.supply_v * charge
    return found


def delays(f: FrontEnd, inputs_v: tuple[float, ...] = (100e-3, 10e-3, 1e-3, 0.1e-3, 0.01e-3)) -> Data:
    """Return the delay from strobe to output for each input, and the time constant of the latch."""
    found = []
    for volts in inputs_v:
        lines = [*clocked(f), *comparator(f), *inputs(f, volts), f".tran 1n {CYCLE_S / 2:g}"]
        half = f.supply_v / 2
        measure = f"delay trig v(ck) val={half:g} rise=1 targ v(op) val={half:g} rise=1"
        found.append(simulate(f.circuit(*lines), [measure, f"out find v(op) at={CYCLE_S / 2.2:g}"]).get("delay"))
    small = [(math.log(v), d) for v, d in zip(inputs_v, found, strict=True) if d is not None and v <= 1e-3]
    slope = np.polyfit([x for x, _ in small], [d for _, d in small], 1)[0] if len(small) > 1 else None
    return {"inputs_v": list(inputs_v), "delays_s": found, "latch_tau_s": None if slope is None else -float(slope)}


def thresholds(f: FrontEnd, cells: str, names: list[str], state: int = 0) -> NDArray[np.float64]:
    """Return the input at which each comparator changes its answer, found by halving; all run side by side."""
    low, high = np.full(len(names), -REACH_V), np.full(len(names), REACH_V)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        lines = [cells, *clocked(f)]
        for number, (name, volts) in enumerate(zip(names, middle, strict=True)):
            lines += [*comparator(f, number, name, state), *inputs(f, volts, number)]
        high_out = answers(f, lines, len(names), "1n")
        low, high = np.where(high_out, low, middle), np.where(high_out, middle, high)
    return (low + high) / 2


def subcircuit(netlist: str) -> list[str]:
    """Return the lines of the comparator's subcircuit."""
    found = COMPARATOR.search(netlist)
    if found is None:
        raise InputError("the netlist must have a line '.ends' after '.subckt comparator'")
    return found[0].splitlines()


def varied(netlist: str, name: str, rng: np.random.Generator) -> str:
    """Return the comparator's subcircuit under another name, each transistor with a random threshold voltage."""

    def vary(line: str) -> str:
        for model, w_nm, l_nm in sizes(line):  # none, or that of the transistor
            sigma_v = MISMATCH_V_UM["pfet" if "pfet" in model else "nfet"] / math.sqrt(w_nm * l_nm * 1e-6)
            line += f" delvto={rng.normal(0, sigma_v):.5g}"
        return line

    first, *lines = subcircuit(netlist)
    return "\n".join([re.sub(r"(?i)\.subckt\s+comparator", f".subckt {name}", first), *map(vary, lines)])


def offset(f: FrontEnd, samples: int = 40, seed: int = 1) -> Data:
    """Return the systematic offset, and offsets of comparators with mismatch."""
    rng = np.random.default_rng(seed)
    names = [f"comparator{number}" for number in range(samples)]
    cells = "\n".join(varied(f.cells, name, rng) for name in names)
    found = thresholds(f, cells, ["comparator", *names])
    (after_high,) = thresholds(f, "", ["comparator"], state=1)
    return {
        "hysteresis_v": float(found[0] - after_high),
        "systematic_v": float(found[0]),
        "samples_v": found[1:].tolist(),
        "sigma_v": float(found[1:].std(ddof=1)),
        "mismatch_v_um": MISMATCH_V_UM,
    }


def own_offsets(taxel: Taxel) -> list[float]:
    """Return the input of each side at which it changes its answer, at mid scale: both sides fire, and kick back."""
    reference, step, found = taxel.middle * taxel.grid, taxel.config.step, []
    for side in range(len(taxel.sides)):
        at_zero = taxel.inputs_v(0.0, reference, step, 1.0)[side]
        low, high = -REACH_V, REACH_V
        for _ in range(HALVINGS + 3):  # a slow signal takes many ticks for 0.1 mV
            middle = (low + high) / 2
            answer = compare(taxel, middle - at_zero, reference, step)[side]
            low, high = (low, middle) if answer == (side == 0) else (middle, high)
        found.append((low + high) / 2)
    return found


def kick_back(f: FrontEnd, input_v: float, capacitor_f: float) -> Data:
    """Return the largest change of an input that a capacitor holds, and the change that stays after a decision."""
    lines = [*clocked(f), *comparator(f), f"Cp p 0 {capacitor_f:g}", f"Cm n 0 {capacitor_f:g}"]
    level = f.supply_v / 2
    lines += [f".ic v(p)={level + input_v:g} v(n)={level:g}", f".tran 1n {CYCLE_S:g}"]
    measures = [
        f"least min v(p) from=0 to={CYCLE_S:g}",
        f"end find v(p) at={0.99 * CYCLE_S:g}",
        f"dev find v(n) at={0.99 * CYCLE_S:g}",
    ]
    found = simulate(f.circuit(*lines), measures)
    return {
        "capacitor_f": capacitor_f,
        "peak_v": level + input_v - found["least"],
        "left_v": level + input_v - found["end"],
        "left_difference_v": input_v - (found["end"] - found["dev"]),
    }


def input_pair(f: FrontEnd) -> list[list[str]]:
    """Return the words of the two lines of the comparator whose gates are inp and inn."""
    words = [line.split() for line in subcircuit(f.cells) if line.strip().lower().startswith("m")]
    found: list[list[str]] = [next((line for line in words if line[2].lower() == gate), []) for gate in ("inp", "inn")]
    if not all(found):
        raise InputError("the netlist needs a transistor whose gate is inp, and one whose gate is inn")
    return found


def transconductance(f: FrontEnd) -> float:
    """Return gm of an input transistor as it begins to discharge: drain at the supply, source at ground."""
    model, lines = " ".join(input_pair(f)[0][5:]), []
    for name, volts in (("a", f.supply_v / 2 - 1e-3), ("b", f.supply_v / 2 + 1e-3)):
        lines += [f"Vd{name} d{name} 0 {f.supply_v:g}", f"Vg{name} g{name} 0 {volts:g}"]
        lines.append(f"M{name} d{name} g{name} 0 0 {model}")
    found = simulate(f.circuit(*lines, ".tran 1n 10n"), ["a find i(vda) at=5n", "b find i(vdb) at=5n"])
    return (found["a"] - found["b"]) / 2e-3


def noise(f: FrontEnd, inputs_v: tuple[float, ...] = (-0.4e-3, 0.0, 0.4e-3), copies: int = 100) -> Data:
    """Return the input-referred noise of a comparator: the shares of high answers, fitted by a Gaussian.

    White noise currents of 4 k T gamma gm flow through the two input transistors, with the gm of their first moment:
    an upper bound. Noise of the cross-coupled transistors, which comes later, is left out.
    """
    gm = transconductance(f)
    density = 4 * BOLTZMANN_J_PER_K * (273.15 + f.temperature_c) * GAMMA * gm
    white = f"dc 0 trnoise({math.sqrt(density / (2 * FINE_S)):.5g} {FINE_S:g} 0 0)"
    shares = []
    for seed, volts in enumerate(inputs_v, 1):
        lines = [f".options seed={seed}", *clocked(f)]
        for n in range(copies):
            lines += [*comparator(f, n), *inputs(f, volts, n)]
            for side, words in zip("pn", input_pair(f), strict=True):
                lines.append(f"I{side}{n} xc{n}.{words[1]} xc{n}.{words[3]} {white}")
        shares.append(float(answers(f, lines, copies, "50p").mean()))
    slope, at_zero = np.polyfit(inputs_v, ndtri(np.clip(shares, 0.5 / copies, 1 - 0.5 / copies)), 1)
    return {
        "gm_s": gm,
        "inputs_v": list(inputs_v),
        "high": shares,
        "decisions": copies,
        "sigma_v": 1 / float(slope),
        "offset_v": -float(at_zero / slope),
    }


def dac(taxel: Taxel, period_s: float, references: list[int]) -> Data:
    """Return gain, offset and INL of the ON side from the top plate just before the comparators fire, and energies."""
    tops, energies = [], []
    for reference in references:
        found = decide(taxel, taxel.volts(reference), reference, taxel.config.step, period_s)
        tops.append(found.top_v)
        energies.append(found.energy_j)
    level = np.array(references) / taxel.grid - taxel.middle
    moved = taxel.front_end.supply_v / 2 + level * taxel.unit_v - np.array(tops)  # by the reference and the half-width
    gain, at_zero = np.polyfit(level, moved / taxel.unit_v, 1)
    inl = moved / taxel.unit_v - gain * level - at_zero
    return {
        "references": references,
        "energies_j": energies,
        "unit_v": taxel.unit_v,
        "gain": float(gain),
        "inl_units": float(np.abs(inl).max()),
        "inl_mismatch_units": _mismatch_inl(taxel),
    }


def _mismatch_inl(taxel: Taxel, samples: int = 1000, seed: int = 1) -> float:
    """Return the INL that 99 % of DACs with mismatch of the capacitors stay within, in units."""
    rng, weights = np.random.default_rng(seed), np.array([1 << bit for bit in range(taxel.bits - 1)])
    share = CAPACITOR_MISMATCH / math.sqrt(taxel.front_end.unit_f * 1e15)
    errors = rng.normal(0, 1, (samples, len(weights))) * share * np.sqrt(weights)
    codes = np.arange(1 << taxel.bits - 1)[:, None] >> np.arange(len(weights)) & 1
    away = codes @ errors.T
    line = np.arange(len(codes)) / (len(codes) - 1)
    return float(np.quantile(np.abs(away - line[:, None] * away[-1]).max(0), 0.99))


def leakage(taxel: Taxel) -> float:
    """Return the leakage power of a resting taxel in watts."""
    f = taxel.front_end
    lines = [
        *taxel.netlist(),
        f"Vx x 0 {f.supply_v / 2:g}",
        f"Vs smpn 0 0\nVc convn 0 {f.supply_v:g}\nVk ckn 0 {f.supply_v:g}",
    ]
    lines += taxel.codes(0, taxel.config.step)
    return -f.supply_v * simulate(f.circuit(*lines, ".tran 1u 10u"), ["leak find i(vdd) at=9u"])["leak"]


def corners(f: FrontEnd, config: ReadoutConfig) -> list[Data]:
    """Return energy, delay at 1 mV and leakage at all corners at 27 C, and at the typical corner at -40 and 125 C."""
    rows = []
    for corner, celsius in [*((corner, 27.0) for corner in CORNERS), ("tt", -40.0), ("tt", 125.0)]:
        at = f.replace(corner=corner, temperature_c=celsius)
        delay = delays(at, (1e-3,))["delays_s"][0]
        leak = {"delay_s": delay, "leakage_w": leakage(Taxel(at, config))}
        rows.append({"corner": corner, "temperature_c": celsius, **energy(at), **leak})
    return rows
