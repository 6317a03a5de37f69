"""What the page of events and frames claims."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from docs.tables.accuracy import p_value, rate, sweep
from docs.tables.claims import claim
from docs.tables.claims.robustness import disturbed
from docs.tables.merits import merits
from docs.tables.written import digits, read

PAGE = "docs/results/what_events_are_good_for.md"
LEVELS = {"lcs": "LCS", "nlcs": "N-LCS", "frame": "frames"}


def points(network: str, mode: str) -> dict[float, dict[str, Any]]:
    """Return the points of a network by noise in volts."""
    kept = read("docs/data/classifier/noise_power.json")["points"]
    return {p["noise_v"]: p for p in kept if (p["network"], p["mode"]) == (network, mode)}


def paired(mode: str, noise: float) -> dict[str, Any]:
    """Return the comparison of LCS 4 b and frames at one noise."""
    kept = read("docs/data/classifier/noise_power.json")["pairs"]
    (found,) = (p for p in kept if (p["mode"], p["noise_v"]) == (mode, noise))
    assert (found["first"], found["second"]) == ("lcs-4", "frame-onoff")
    return dict(found)


def micro(network: str, mode: str, noise: float) -> float:
    """Return a total power in microwatts."""
    return 1e6 * float(points(network, mode)[noise]["power_w"]["total"])


def percent(network: str, mode: str, noise: float) -> float:
    """Return an accuracy in per cent."""
    return 100 * float(points(network, mode)[noise]["accuracy"])


@claim(PAGE)
def protocol() -> Iterator[str]:
    """What was compared."""
    (lcs,) = (p for p in sweep("paper-network") if (p["readout"], p["resolution"]) == ("lcs", 4))
    tested = {network: points(network, "paper")[0.001] for network in ("lcs-4", "lcs-6")}
    frames = points("frame-onoff", "paper")[0.001]["data_rate_bps"] / 640e3
    assert tested["lcs-4"]["folds"] == [0, 1, 2]
    assert tested["lcs-6"]["folds"] == [0]
    yield f"`lcs-4` ({float(rate(lcs)):.2f} of 640 kb/s)"
    yield f"ON/OFF counts of 1/16, {frames:.2f}) folds 0 to 2, {tested['lcs-4']['images']} test images"
    yield f"the other networks fold 0, {tested['lcs-6']['images']} images"
    yield f"Rest and timing: {merits()['textures']} textures"


@claim(PAGE)
def wins() -> Iterator[str]:
    """Where events win."""
    sooner = [
        p["time_s"] for p in merits()["latency_pairs"] if p["p"] < 0.05 and p["accuracy_first"] > p["accuracy_second"]
    ]
    cheaper = [
        noise
        for noise in points("lcs-4", "paper")
        if micro("lcs-4", "paper", noise) < micro("frame-onoff", "paper", noise)
    ]
    even = [v for v in cheaper if paired("paper", v)["p"] >= 0.05]
    yield f"the answer after {1e3 * min(sooner):.0f} to {1e3 * max(sooner):.0f} ms"
    yield "in the published power model, {:g} and {:g} mV of noise".format(*(1e3 * v for v in even))


@claim(PAGE)
def latency() -> Iterator[str]:
    """When the networks know."""
    pairs = {round(1e3 * p["time_s"]): p for p in merits()["latency_pairs"]}
    assert all(pairs[ms]["accuracy_first"] > pairs[ms]["accuracy_second"] for ms in (50, 70))
    assert min(p["p"] for ms, p in pairs.items() if ms >= 100 or 14 <= ms <= 40) > 0.05
    yield (
        f"At 50 and 70 ms LCS is ahead (p {digits(pairs[50]['p'], 1)} and {digits(pairs[70]['p'], 1)} of {len(pairs)} "
        "comparisons"
    )
    yield f"they cannot be told apart on {pairs[100]['images']} images"
    assert pairs[50]["accuracy_first"] >= 0.5 > pairs[40]["accuracy_first"]
    assert pairs[100]["accuracy_second"] >= 0.5 > pairs[70]["accuracy_second"]
    yield "half of the images are right after 50 ms (LCS) and between 70 and 100 ms (frames)"


@claim(PAGE)
def rest() -> Iterator[str]:
    """What is sent while a touch rests and while it moves."""
    by = {(row["readout"], row["phase"], row["noise_v"]): row for row in merits()["rest"]}

    def kilobits(readout: str, phase: str, noise: float, name: str = "sent_bps") -> float:
        return float(by[readout, phase, noise][name]) / 1e3

    frame = "frame:500:6"
    yield f"frames go on at {kilobits(frame, 'resting', 0.0):.0f} kb/s"
    yield f"What frames need after coding is {kilobits(frame, 'resting', 0.0, 'coded_bps'):.1f} kb/s"
    yield (
        f"With 10 mV it sends {kilobits('cw-lcs:3', 'resting', 0.01):.0f} kb/s, coded frames "
        f"{kilobits(frame, 'resting', 0.01, 'coded_bps'):.0f}, LCS of the same resolution "
        f"{kilobits('lcs:3', 'resting', 0.01):.1f}"
    )
    yield (
        f"coded frames need {kilobits(frame, 'moving', 0.0, 'coded_bps'):.0f} kb/s, LCS 3 b sends "
        f"{kilobits('lcs:3', 'moving', 0.0):.0f} and N-LCS 6 b {kilobits('nlcs:6', 'moving', 0.0):.0f}"
    )


@claim(PAGE)
def timing() -> Iterator[str]:
    """How well a time is known."""
    rows = {(row["known_from"], row["rate_hz"]): row for row in merits()["timing"]}
    events = next(row for (known, _), row in rows.items() if known == "events")
    frames, lines = rows["frames", 500], rows["interpolated", 500]
    yield (
        f"Events know a crossing to {1e6 * events['median_s']:.0f} us (median, {1e6 * events['p95_s']:.0f} us in 95 %) "
        f"at {events['sent_bps'] / 640e3:.2f} of 640 kb/s"
    )
    yield (
        f"Frames of that rate (500 Hz) to {1e3 * frames['median_s']:.0f} ms, or {1e6 * lines['median_s']:.0f} us "
        "between "
        f"straight lines, and miss {100 * (1 - frames['found']):.0f} % of the crossings"
    )
    reached = min(rate for (known, rate), row in rows.items() if known == "interpolated" and row["median_s"] < 27.5e-6)
    yield f"Frames reach the events' precision from {reached / 1e3:.0f} kHz on"


@claim(PAGE)
def corrected() -> Iterator[str]:
    """Accuracy and power with all corrections."""
    mode, noise = "consistent", 0.001
    cost = {name: micro(name, mode, noise) for name in ("frame-onoff", "lcs-4", "nlcs-6", "lcs-6", "nlcs-8")}
    yield (
        f"frames cost {cost['frame-onoff']:.1f} uW, LCS 4 b {cost['lcs-4']:.1f}, N-LCS 6 b {cost['nlcs-6']:.1f}, "
        f"LCS 6 b {cost['lcs-6']:.0f} and N-LCS 8 b {cost['nlcs-8']:.0f} uW** from 1 mV on"
    )
    events = points("lcs-4", mode)[noise]["rate_hz"], points("frame-onoff", mode)[noise]["rate_hz"]
    yield f"each of {round(events[0], -2):,.0f} events, frames 4 for each of {events[1]:,.0f} samples"
    more, same, less = (paired(mode, noise) for noise in (0.001, 0.01, 0.02))
    assert less["p"] < 0.001
    yield (
        f"LCS 4 b is right more often at 1 mV ({_against(more)}), not at 10 mV ({_against(same)}), and less often at "
        f"20 mV ({_against(less)})"
    )


def _against(pair: dict[str, Any]) -> str:
    both = (100 * pair[f"accuracy_{which}"] for which in ("first", "second"))
    return "{:.1f} against {:.1f} %, p {}".format(*both, p_digit(pair))


def p_digit(pair: dict[str, Any]) -> str:
    """Return the p of a pair in one digit; one that is very small as a bound."""
    return digits(pair["p"], 1) if pair["p"] >= 1e-3 else p_value(pair["p"])


@claim(PAGE)
def published() -> Iterator[str]:
    """Accuracy and power in the published model."""
    mode = "paper"
    yield (
        f"LCS 4 b costs {micro('lcs-4', mode, 0.001):.0f} uW at 1 mV and {micro('lcs-4', mode, 0.003):.0f} uW at 3 mV, "
        f"frames {micro('frame-onoff', mode, 0.001) / 1e3:.1f} mW"
    )
    one, three, ten = (paired(mode, noise) for noise in (0.001, 0.003, 0.01))
    assert f"{one['accuracy_first']:.3f}" == f"{three['accuracy_first']:.3f}"
    yield (
        f"({100 * one['accuracy_first']:.1f} against {100 * one['accuracy_second']:.1f} and "
        f"{100 * three['accuracy_second']:.1f} %, p {p_digit(one)} and {p_digit(three)})"
    )
    yield f"the AFE of 64 taxels ({1e3 * points('lcs-4', mode)[0.0001]['power_w']['afe']:.1f} mW)"
    yield (
        f"LCS 4 b is right in {100 * ten['accuracy_first']:.0f} %, frames in {100 * ten['accuracy_second']:.0f} "
        f"(p {p_digit(ten)})"
    )


@claim(PAGE)
def noise() -> Iterator[str]:
    """What noise does to each readout."""
    fine = points("lcs-6", "paper")
    clean = fine[0.0001]
    yield f"it sends {fine[0.01]['rate_hz'] / clean['rate_hz']:.1f} times the events and its network guesses"
    fallen = max(fine[v]["accuracy"] for v in (0.0001, 0.001)) - fine[0.003]["accuracy"]
    yield f"4 b still holds at 3 mV, 6 b has lost {100 * fallen:.0f} points"
    white, slow = ([percent(name, mode, 0.02) for name in ("nlcs-8", "nlcs-6")] for mode in ("paper", "consistent"))
    yield (f"white noise of 20 mV does not harm ({min(white):.0f} to {max(white):.0f} %, {clean['images']} images)")
    yield f"({min(slow):.0f} to {max(slow):.0f} % at 20 mV)"
    added = [points("lcs-6", mode)[0.003]["rate_hz"] / points("lcs-6", mode)[0.0001]["rate_hz"] - 1 for mode in MODES]
    yield f"(LCS 6 b, 3 mV: {100 * added[1]:.0f} against {100 * added[0]:.0f} %)"
    before, after = (100 * disturbed()["noise", 0.01][network]["accuracy"] for network in ("clean", "robust"))
    yield f"raised 10 mV from {before:.0f} to {after:.0f} %"


MODES = ("paper", "consistent")
