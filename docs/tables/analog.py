"""Tables of the analog taxel: comparator and DAC in transistors, loops with the Verilog, and power."""

from typing import Any

import numpy as np

from docs.tables.netlists import netlists
from docs.tables.power import array_hz, breakdown
from docs.tables.write import Rows, digits, read

TAXELS, TICK_HZ, INTUITIVE_W = 64, 20_000, 12.33e-9
SCAN = "kylberg", "paper"
FRAME_HZ = 194
"""Samples per second and taxel of frames with the bandwidth of the textures, 97 Hz."""


def comparator_report() -> dict[str, Any]:
    """Return the characterisation of comparator and DAC."""
    return dict(read("docs/data/analog/comparator.json"))


def analog_facts() -> Rows:
    """Yield what the comparator and the DAC do, at the typical corner and 27 C."""
    data = comparator_report()
    (typical,) = (row for row in data["corners"]["rows"] if (row["corner"], row["temperature_c"]) == ("tt", 27.0))
    offset, noise, dac, kick = data["offset"], data["noise"], data["dac"], data["kick_back"]
    sample_noise_v = (1.380649e-23 * 300 / kick["capacitor_f"]) ** 0.5
    yield ["energy of a decision, with the buffer of its strobe", f"{typical['same_j'] * 1e12:.3f} pJ"]
    yield ["delay at 1 mV; time constant of the latch", _delay(data)]
    yield ["offset by mismatch, standard deviation", f"{offset['sigma_v'] * 1e3:.1f} mV of {len(offset['samples_v'])}"]
    yield [
        "noise of the comparator; of the sampling, kT/C",
        f"{noise['sigma_v'] * 1e3:.2f} mV; {sample_noise_v * 1e3:.2f} mV",
    ]
    yield ["kick-back on 0.26 pF: peak; difference that stays", _kick(kick)]
    yield ["unit of the DAC; its gain", f"{dac['unit_v'] * dac['gain'] * 1e3:.2f} mV; {dac['gain']:.3f}"]
    yield ["INL: circuit; 99 % of DACs by mismatch", f"{dac['inl_units']:.2f}; {dac['inl_mismatch_units']:.2f} units"]
    yield ["leakage of a taxel", f"{typical['leakage_w'] * 1e9:.2f} nW"]


def _delay(data: dict[str, Any]) -> str:
    delay = data["delay"]
    at = delay["delays_s"][delay["inputs_v"].index(1e-3)]
    return f"{at * 1e9:.2f} ns; {delay['latch_tau_s'] * 1e12:.0f} ps"


def _kick(kick: dict[str, Any]) -> str:
    return f"{kick['peak_v'] * 1e3:.0f} mV; {kick['left_difference_v'] * 1e6:.0f} uV"


def analog_corners() -> Rows:
    """Yield energy, delay and leakage at each corner."""
    yield from comparator_report()["corners"]["rows"]


def decision_j() -> tuple[float, float]:
    """Return the energy of a decision of a taxel at reference 0, and its mean over references from end to end."""
    dac = comparator_report()["dac"]
    energies = np.array(dac["energies_j"])
    grid = np.arange(dac["references"][0], dac["references"][-1] + 1)
    return energies[dac["references"].index(0)], float(np.interp(grid, dac["references"], energies).mean())


def idle_w(mean: bool = True) -> dict[str, float]:
    """Return the power of a taxel of LCS 6 b without events: digital part, and comparators with DAC."""
    analog_w = decision_j()[mean] * TICK_HZ + comparator_report()["corners"]["rows"][0]["leakage_w"]
    return {"digital": netlists()["lcs-analog-8x8-ihp"]["idle_w_per_taxel"], "analog": analog_w}


def analog_targets() -> Rows:
    """Yield the targets and results for LCS 6 b."""
    idle, event = sum(idle_w().values()), decision_j()[True]
    rows = (
        ("power without events, nW per taxel", 25, idle * 1e9),
        ("energy of an event in comparators and DAC, pJ", 1, event * 1e12),
    )
    for text, most, value in rows:
        yield [text, str(most), digits(value, 3), "met" if value <= most else "not met"]


def analog_power() -> Rows:
    """Yield the power of LCS 6 b and of frames, for a taxel of 64."""
    rate_hz = array_hz(*SCAN, "lcs", 6) / TAXELS
    report = netlists()["lcs-analog-8x8-ihp"]
    decision = decision_j()[True]
    idle, at_zero = idle_w(), idle_w(mean=False)
    moving = report["energy_per_texture_event_j"] * rate_hz, decision * rate_hz
    paper = breakdown()
    parts = paper["lcs"]["converter_parts"]
    equations_w = sum(parts[name] for name in ("comparator_static", "comparator_dynamic", "dac")) / TAXELS
    one_side_j = float(np.mean(comparator_report()["one_side"]["energies_j"]))
    frame_digital_w = breakdown("ihp")["frame"]["converter_parts"]["logic"] / TAXELS

    def row(text: str, digital_w: float | None, analog_w: float | None, total_w: float) -> list[str]:
        cells = ("" if watts is None else digits(watts * 1e9, 3) for watts in (digital_w, analog_w))
        return [text, *cells, digits(total_w * 1e9, 3)]

    yield row("LCS, no events, reference at 0", at_zero["digital"], at_zero["analog"], sum(at_zero.values()))
    yield row("LCS, no events, mean over references", idle["digital"], idle["analog"], sum(idle.values()))
    both = [a + b for a, b in zip(idle.values(), moving, strict=True)]
    yield row(f"LCS on the textures, {rate_hz:,.0f} events/s a taxel", *both, sum(both))
    yield row(
        "LCS on the textures, comparators and DAC by the paper's equations", both[0], equations_w, both[0] + equations_w
    )
    sar_w = 6 * one_side_j * FRAME_HZ
    yield row(f"frames of {FRAME_HZ} Hz, SAR of 6 b", frame_digital_w, sar_w, frame_digital_w + sar_w)
    fast_w = 6 * one_side_j * TICK_HZ
    yield row("frames of 20 kHz, SAR of 6 b, without logic", None, fast_w, fast_w)
    yield row("INTUITIVE, N-LCS and LCS, whole taxel", None, None, INTUITIVE_W)
