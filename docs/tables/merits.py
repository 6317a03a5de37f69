"""What events and frames are good for."""

from __future__ import annotations

from typing import Any

from docs.tables.accuracy import p_value
from docs.tables.written import digits, markdown, read, table


def merits() -> dict[str, Any]:
    """Return what ``python -m snn merits`` found."""
    return dict(read("docs/data/classifier/merits.json"))


@table
def merits_latency() -> str:
    """Accuracy over the time since the touch, of two networks and image by image."""
    data = merits()
    names = list(dict.fromkeys(p["network"] for p in data["latency"]))
    rows = []
    for pair in data["latency_pairs"]:
        points = [p for p in data["latency"] if p["time_s"] == pair["time_s"]]
        ends = [" to ".join(f"{100 * end:.0f}" for end in p["bootstrap_95"]) for p in points]
        shown = [f"{100 * p['accuracy']:.1f} % ({end})" for p, end in zip(points, ends, strict=True)]
        parted = f"{pair['only_first']}, {pair['only_second']}"
        rows.append([f"{1e3 * pair['time_s']:.0f} ms", *shown, parted, p_value(pair["p"])])
    return markdown(["since the touch", *names, "only one right", "McNemar p"], rows)


@table
def merits_rest() -> str:
    """Bits per second while a touch moves and while it rests, as sent and coded."""
    data = merits()["rest"]
    by = {(row["readout"], row["phase"], row["noise_v"]): row for row in data}
    rows = []
    for readout in dict.fromkeys(row["readout"] for row in data):
        cells = [f"`{readout}`"]
        for phase, noise in (("moving", 0.0), ("resting", 0.0), ("resting", 0.001), ("resting", 0.01)):
            row = by[readout, phase, noise]
            cells.append(" / ".join(f"{1e-3 * row[key]:.2f}" for key in ("sent_bps", "coded_bps")))
        rows.append(cells)
    return markdown(["", "moving", "resting", "resting, 1 mV", "resting, 10 mV"], rows)


@table
def merits_timing() -> str:
    """How well the time of a crossing is known, from events and from frames."""
    rows = [
        [
            f"{row['known_from']}, {row['rate_hz']:g} Hz",
            f"{row['sent_bps'] / 640e3:.2f}",
            f"{100 * row['found']:.1f} %",
            f"{1e6 * row['median_s']:.0f}",
            f"{1e6 * row['p95_s']:.0f}",
        ]
        for row in merits()["timing"]
    ]
    return markdown(["known from", "normalised rate", "crossings found", "median error, us", "95 % below, us"], rows)


@table
def noise_power() -> str:
    """Accuracy, rate and power at one noise, in both modes."""
    points = read("docs/data/classifier/noise_power.json")["points"]
    by = {(p["network"], p["mode"], p["noise_v"]): p for p in points}
    rows = []
    for network, mode, noise in by:
        if mode == "paper":
            pair = [by[network, one, noise] for one in ("paper", "consistent")]
            cells = [f"`{network}`", f"{1e3 * noise:g} mV", f"{pair[0]['images']}"]
            for p in pair:
                low, high = p["wilson_95"]
                accuracy = f"{100 * p['accuracy']:.1f} % ({100 * low:.0f} to {100 * high:.0f})"
                cells += [accuracy, f"{p['rate_hz']:,.0f}", f"{digits(1e6 * p['power_w']['total'], 3)}"]
            rows.append(cells)
    head = [f"{mode}: {what}" for mode in ("paper", "consistent") for what in ("accuracy", "events/s", "uW")]
    return markdown(["network", "v_n", "images", *head], rows)
