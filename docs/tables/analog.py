"""Tables of the analog taxel: comparator and DAC in transistors, loops with the Verilog, and power."""

from typing import Any

import numpy as np

from docs.tables.netlists import netlists
from docs.tables.power import array_hz, breakdown
from docs.tables.write import Rows, digits, only, read

TAXELS, TICK_HZ, INTUITIVE_W = 64, 20_000, 12.33e-9
SCAN = "kylberg", "paper"
FRAME_HZ = 194
"""Samples per second and taxel of frames with the bandwidth of the textures, 97 Hz."""
LOOPS = {
    "lcs": "LCS, touch",
    "cw-lcs": "CW-LCS, touch",
    "nlcs": "N-LCS, touch",
    "nlcs-bipolar": "bipolar N-LCS, touch",
    "lcs 2 x 2": "2 x 2 LCS with mismatch, touch",
    "lcs scan": "LCS, texture of 0.4 s",
}
FINGER_TAXELS, FINGER_FRAME_HZ = 16, 12.2


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
    yield [f"kick-back on {kick['capacitor_f'] * 1e12:.2f} pF: peak; difference that stays", _kick(kick)]
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
    return dac["energies_j"][dac["references"].index(0)], _mean_j("dac")


def _mean_j(part: str) -> float:
    dac = comparator_report()[part]
    grid = np.arange(dac["references"][0], dac["references"][-1] + 1)
    return float(np.interp(grid, dac["references"], dac["energies_j"]).mean())


def leakage_w() -> float:
    """Return the leakage of comparators and DAC at the typical corner."""
    return float(comparator_report()["corners"]["rows"][0]["leakage_w"])


def idle_w(mean: bool = True) -> dict[str, float]:
    """Return the power of a taxel of LCS 6 b without events: digital part, and comparators with DAC."""
    analog_w = decision_j()[mean] * TICK_HZ + leakage_w()
    return {"digital": netlists()["lcs-analog-8x8-ihp"]["idle_w_per_taxel"], "analog": analog_w}


def analog_targets() -> Rows:
    """Yield the targets and results for LCS 6 b."""
    idle, event = sum(idle_w().values()), decision_j()[True]
    rows = (
        ("power without events, nW per taxel", 25, idle * 1e9),
        ("energy of an event on the textures, in comparators and DAC, pJ", 1, event * 1e12),
    )
    for text, most, value in rows:
        yield [text, str(most), digits(value, 3), "met" if value <= most else "not met"]


def analog_power() -> Rows:
    """Yield the power of a taxel in an array of 64 with events and with frames, and with the events of the finger."""
    lcs, nlcs = netlists()["lcs-analog-8x8-ihp"], netlists()["nlcs-analog-8x8-ihp"]
    texture_hz, most_hz = array_hz(*SCAN, "lcs", 6) / TAXELS, lcs["clock_hz"] / TAXELS
    at_zero, idle = idle_w(mean=False), idle_w()

    def row(text: str, digital_w: float | None, analog_w: float) -> list[str]:
        cells = ("" if watts is None else digits(watts * 1e9, 3) for watts in (digital_w, analog_w))
        return [text, *cells, digits(((digital_w or 0.0) + analog_w) * 1e9, 3)]

    def sends(text: str, rate_hz: float, event_j: float) -> list[str]:
        text = f"{text}, {rate_hz:,.0f} events/s"
        return row(text, idle["digital"] + event_j * rate_hz, idle["analog"] + decision_j()[True] * rate_hz)

    yield row("LCS 6 b, no events, reference at 0", *at_zero.values())
    yield row("LCS 6 b, no events, mean over references", *idle.values())
    yield sends("alone: only this taxel", texture_hz, lcs["energy_per_lone_event_j"])
    yield sends("textures: all taxels", texture_hz, lcs["energy_per_texture_event_j"])
    busy_w = idle["digital"] + lcs["energy_per_event_j"] * most_hz
    text = f"busy: an event and all comparators in every clock, {most_hz:,.0f} events/s"
    yield row(text, busy_w, decision_j()[True] * lcs["clock_hz"] + leakage_w())
    parts = breakdown()["lcs"]["converter_parts"]
    equations_w = sum(parts[name] for name in ("comparator_static", "comparator_dynamic", "dac")) / TAXELS
    digital_w = idle["digital"] + lcs["energy_per_texture_event_j"] * texture_hz
    yield row("textures, comparators and DAC by the paper's equations", digital_w, equations_w)
    yield sends("finger", finger_hz("lcs:6"), lcs["energy_per_lone_event_j"])
    rate_hz = finger_hz("nlcs:4")
    asked_hz = TICK_HZ * (1 + 1 / nlcs["configuration"]["leak_period"]) + rate_hz
    digital_w = nlcs["idle_w_per_taxel"] + nlcs["energy_per_lone_event_j"] * rate_hz
    text = f"finger, N-LCS 4 b with circuits of 6 b, {rate_hz:,.0f} events/s"
    yield row(text, digital_w, _mean_j("one_side_6b") * asked_hz + leakage_w())
    yield row(f"frames of {FRAME_HZ} Hz, SAR of 6 b", *frame_w(FRAME_HZ, 6))
    yield row(f"finger, frames of {FINGER_FRAME_HZ} Hz, SAR of 9 b", *frame_w(FINGER_FRAME_HZ, 9))
    yield row("frames of 20 kHz, SAR of 6 b, without logic", None, frame_w(TICK_HZ, 6)[1])
    yield ["INTUITIVE, N-LCS and LCS, whole taxel", "", "", digits(INTUITIVE_W * 1e9, 3)]


def finger_hz(name: str) -> float:
    """Return the events/s of a taxel on the recordings of the finger that keep the level."""
    points = read("docs/data/finger.json")["level"]["points"]
    return float(only(points, point=name)["events_per_s"]) / FINGER_TAXELS


def frame_w(rate_hz: float, bits: int) -> tuple[float, float]:
    """Return the power of a taxel read by frames: digital part, and a SAR of the same comparator and DAC."""
    report = netlists()["frame-8x8-ihp"]
    digital_w = report["idle_w_per_taxel"] + report["energy_per_event_j"] * rate_hz
    return digital_w, bits * _mean_j(f"one_side_{bits}b") * rate_hz


def analog_answer() -> dict[str, float]:
    """Return the power of LCS and frames on the textures, and the frame rate that needs the power of resting LCS."""
    idle = idle_w()
    fixed, sample = sum(frame_w(0.0, 6)), sum(frame_w(1.0, 6)) - sum(frame_w(0.0, 6))
    return idle | {
        "frames": sum(frame_w(FRAME_HZ, 6)),
        "rest": sum(idle.values()),
        "hz": (sum(idle.values()) - fixed) / sample,
    }


def analog_loops() -> Rows:
    """Yield the loops of transistors and Verilog: a touch for each encoder, and a scan."""
    for name in ("loops", "scan"):
        for row in read(f"docs/data/analog/{name}.json")["rows"]:
            yield row | {"text": LOOPS[row["name"]]}


def worst_missed() -> float:
    """Return the largest share of events that the behavioural comparator puts into another tick."""
    return float(max(row["missed"]["measured"] / row["events"] for row in analog_loops()))


def idle_parts() -> dict[str, float]:
    """Return the power of a taxel without events: leakage of the gates, clocked flops, and comparators with DAC."""
    idle, leakage = idle_w(), netlists()["lcs-analog-8x8-ihp"]["leakage_w_per_taxel"]
    return {"leakage": leakage, "clocked": idle["digital"] - leakage, "analog": idle["analog"]}
