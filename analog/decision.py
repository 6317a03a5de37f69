"""One decision of an analog taxel by transistors: a transient of one clock."""

from __future__ import annotations

from dataclasses import dataclass

from eskin.analog.circuit import Taxel
from eskin.analog.ngspice import simulate

EDGE_S = 0.2e-9
HOLDS, MOVES, FIRES, RESTS, TRACKS = 0.3, 0.35, 0.5, 0.8, 0.9
"""Parts of a clock after which the switches hold the signal, the plates move to the reference, the comparators fire,
they are precharged, and the switches track the signal again."""
GATE_OHM = 10e3
"""Resistance of a gate that holds a bottom plate."""
FINE_S, FINE_STEPS = 50e-12, 40
"""Steps after the comparators fire. Longer steps damp the unstable state of a latch, so that it decides wrongly."""

Points = list[tuple[float, float]]


def waveform(before: float, levels: Points) -> str:
    """Return a source that has a level, and changes to others at given times."""
    points = [f"0 {before:.6g}"]
    for time, level in levels:
        points += [f"{time:.6g} {before:.6g}", f"{time + EDGE_S:.6g} {level:.6g}"]
        before = level
    return f"pwl({' '.join(points)})"


def fine(start_s: float) -> str:
    """Return a source whose corners force short steps from a time on."""
    points = (f"{start_s + step * FINE_S:.6g} {step % 2}" for step in range(FINE_STEPS))
    return f"Vfine fine 0 pwl(0 0 {' '.join(points)})"


def phases(period_s: float, supply_v: float) -> list[str]:
    """Return the sources of the strobe, the plates and the switch of one clock in which the readout asks."""
    times = {"ck": (FIRES, RESTS), "conv": (MOVES, TRACKS), "smp": (HOLDS, TRACKS)}
    lines = []
    for name, (first, second) in times.items():
        idle, active = (0.0, supply_v) if name == "smp" else (supply_v, 0.0)  # the inputs of the buffers, which invert
        levels = [(first * period_s, active), (second * period_s, idle)]
        lines.append(f"V{name} {name}n 0 {waveform(idle, levels)}")
    return lines


@dataclass(frozen=True)
class Decision:
    """What a taxel decided, and what it took."""

    above: bool
    below: bool
    energy_j: float
    top_v: float  # of the ON side, just before the comparators fire


def decide(taxel: Taxel, x_v: float, reference: int, half_width: int, period_s: float) -> Decision:
    """Return a decision; reference and half-width in codes. Nothing is kept from one decision to the next."""
    f = taxel.front_end
    lines = [*taxel.netlist(), f"Vx x 0 {x_v:.7g}", *phases(period_s, f.supply_v), fine(FIRES * period_s)]
    lines += taxel.codes(reference, half_width)
    at = TRACKS * period_s
    names = ("above", "below")[: len(taxel.sides)]
    measures = [f"{name} find v({name}) at={at:.6g}" for name in names]
    found = simulate(
        f.circuit(*lines, f".tran 50n {period_s:.6g}"),
        [
            *measures,
            f"charge integ i(vdd) from=0 to={period_s:.6g}",
            f"top find v(topon) at={FIRES * period_s - 1e-9:.6g}",
        ],
    )
    above, below = (found.get(name, 0.0) > f.supply_v / 2 for name in ("above", "below"))
    return Decision(above, below, -f.supply_v * found["charge"], found["top"])


def compare(taxel: Taxel, x_v: float, reference: int, half_width: int, gain: float = 1.0) -> tuple[bool, bool]:
    """Return the decisions above and below, of a transient that begins when the comparators fire.

    It starts from the charge of the DAC, which is computed: the top plates have moved by the reference and the
    half-width, in units of ``gain * unit_v``. A tenth of the devices and steps of ``decide`` remain.
    """
    f, begin = taxel.front_end, 0.2e-9
    lines = [*taxel.comparators(), f"Vck ckn 0 {waveform(f.supply_v, [(begin, 0.0)])}"]
    for plate in {**taxel.plates, **taxel.dummies, **{p: 1 for side in taxel.sides for p in taxel.width_plates(side)}}:
        lines.append(f"R{plate} {plate} 0 {GATE_OHM:g}")
    tops = {"middle": f.supply_v / 2}
    for side, input_v in zip(taxel.sides, taxel.inputs_v(x_v, reference, half_width, gain), strict=True):
        tops[f"top{side}"] = f.supply_v / 2 + input_v
    lines.append(" ".join([".ic", *(f"v({node})={volts:.7g}" for node, volts in tops.items())]))
    end = begin + FINE_S * FINE_STEPS + 0.5e-9
    names = ("above", "below")[: len(taxel.sides)]
    measures = [f"{name} find v({name}) at={0.999 * end:.6g}" for name in names]
    found = simulate(f.circuit(*lines, f".tran {FINE_S:g} {end:.6g} 0 {FINE_S:g}"), measures)
    above, below = (found.get(name, 0.0) > f.supply_v / 2 for name in ("above", "below"))
    return above, below
