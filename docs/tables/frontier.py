"""Tables of the frontier: chosen taxels, encoders and frames at equal rates."""

import statistics
from typing import Any

from docs.tables.write import Rows, filled, only, read, table
from eskin.snn.experiments.pairs import compare

LCS_LEAKY = "physical/leaky-2ms/lcs:2/12x16:across:12"
BIPOLAR_LEAKY = "physical/leaky-2ms/nlcs-bipolar:2/12x16:across:12"
FRAMES_LEAKY = "physical/leaky-2ms/frame-onoff:250:3:2/12x16:across:12"
"""Points of the frontier in the README and in sentences of docs/results/frontier.md."""

NETWORKS = {"leaky": "leaky", "leaky-2ms": "leaky", "convolutions": "convolutions", "paper": "the paper's"}

Data = dict[str, Any]


def at(name: str) -> Data:
    """Return the frontier point of a given name."""
    return only(read("docs/data/frontier.json")["points"], name=name)


def chosen(preset: str, network: str) -> dict[tuple[str, int], Data]:
    """Return the points that inner validation chose, by kind of readout and by budget in events/s."""
    data = read("docs/data/frontier.json")
    points = {point["name"]: point for point in data["points"]}
    return {
        (_kind(one["name"]), one["budget_hz"]): points[one["name"]]
        for one in data["inner"]
        if one["chosen"] and one["name"].startswith(f"{preset}/{network}/")
    }


def _kind(name: str) -> str:
    kind = name.split("/")[2].partition(":")[0]
    return "frame" if kind.startswith("frame") else kind


TRAININGS = (("physical", "leaky-2ms"), ("physical", "convolutions"), ("paper", "leaky"), ("paper", "convolutions"))
"""Scans and networks of the comparison."""


def holm(p_values: list[float]) -> list[float]:
    """Return p values after Holm's correction for several tests (S. Holm, Scand. J. Statist. 6(2):65, 1979)."""
    order = sorted(range(len(p_values)), key=p_values.__getitem__)
    found, least = [0.0] * len(order), 0.0
    for rank, number in enumerate(order):
        least = max(least, (len(order) - rank) * p_values[number])
        found[number] = min(1.0, least)
    return found


def significant() -> dict[str, Data]:
    """Return the significant comparisons with LCS, by the name of the other point.

    A comparison is significant if McNemar's p, the median over the seeds, is below 0.05 after Holm's correction for
    all comparisons.
    """
    return {pair["second"]: pair for pair, p in _corrected() if p < 0.05}


def _corrected() -> list[tuple[Data, float]]:
    pairs = read("docs/data/frontier.json")["pairs"]
    compared = []
    for preset, network in TRAININGS:
        found = chosen(preset, network)
        for (kind, budget), point in found.items():
            if kind != "lcs":
                compared.append(only(pairs, first=found["lcs", budget]["name"], second=point["name"]))
    return list(zip(compared, holm([statistics.median(pair["p"]) for pair in compared]), strict=True))


def against(kind: str) -> Data:
    """Return in how many comparisons a kind of readout is significantly more or less accurate than LCS."""
    of = [(pair, p < 0.05) for pair, p in _corrected() if _kind(pair["second"]) == kind]
    gains = [pair["difference"] for pair, differs in of if differs]
    return {"of": len(of), "more": sum(gain > 0 for gain in gains), "less": sum(gain < 0 for gain in gains)}


def frontier() -> None:
    """Print accuracy, data rate and power of LCS and frames for every scan, network and limit."""
    rows, marked = [], significant()
    for preset, network in TRAININGS:
        found = chosen(preset, network)
        budgets = list(dict.fromkeys(budget for _, budget in found))
        for kind in ("lcs", "frame"):
            cells = []
            for point in (found[kind, budget] for budget in budgets):
                mark = "**" if point["name"] in marked else ""
                cells.append(
                    filled(
                        "{m}{accuracy:100*.1f} %{m}, {bits_per_s:1e-3*#3} kb/s, {power_w:1e9*#2} nW",
                        point | {"m": mark},
                    )
                )
            rows.append([f"{preset}, {NETWORKS[network]}", filled("{kind:E}", {"kind": kind}), *cells])
    table(["scan, network", "readout", *(f"about {budget:,} events/s" for budget in budgets)], rows)


def power_of_frames() -> float:
    """Return the power of frames at 2,200 events/s, leaky neurons, as a share of that of LCS."""
    return float(at(FRAMES_LEAKY)["power_w"] / at(LCS_LEAKY)["power_w"])


def candidates() -> Data:
    """Count the readouts that inner validation compared, and the readouts that it chose."""
    inner = read("docs/data/frontier.json")["inner"]
    return {"tried": len(inner), "chosen": sum(one["chosen"] for one in inner)}


FLOAT_LEAKS = "those of the float network"


def frontier_chip(readout: str, leaks: str = FLOAT_LEAKS) -> Data:
    """Return the result of an RTL chip with chosen taxels, summed over its seeds, and what float weights add.

    ``lead`` is the accuracy of the float network of the frontier minus that of the chip.
    """
    found = only(read("docs/data/frontier_chip.json")["runs"], readout=readout, leaks=leaks)
    sums = {key: sum(one[key] for one in found["of_seeds"]) for key in found["of_seeds"][0]}
    float_network = at(f"physical/leaky-2ms/{readout}/12x16:across:12")
    pair = compare(found["labels"], found["predictions"], float_network["predictions"])
    interval = {"low": pair.interval[0], "high": pair.interval[1]}
    stalled = sums["stalls"] / sums["clocks"]
    return found | sums | {"lead": pair.difference, "a": float_network, "stalled": stalled} | interval


def frontier_chips() -> Rows:
    """Yield a row for each RTL chip with chosen taxels."""
    line = "{kind:E}, {leaks} | {rate_hz:,.0f} | {right} of {images} | {row:%} | {float[accuracy]:100*.1f} % | "
    line += "{a[accuracy]:100*.1f} % | {gain:+%} | {mismatches} of {events:,}"
    for run in read("docs/data/frontier_chip.json")["runs"]:
        chip = frontier_chip(run["readout"], run["leaks"])
        gain = {"difference": -chip["lead"], "interval": [-chip["high"], -chip["low"]]}
        yield filled(line, chip | {"kind": chip["readout"].partition(":")[0], "gain": gain})


def bipolar_chip_against_lcs() -> Data:
    """Return how much more accurate the chip with bipolar N-LCS is than the chip with LCS and the same leaks."""
    first, second = frontier_chip("lcs:2"), frontier_chip("nlcs-bipolar:2")
    pair = compare(first["labels"], first["predictions"], second["predictions"])
    return second | {"gain": pair.difference, "low": pair.interval[0], "high": pair.interval[1]}
