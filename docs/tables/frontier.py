"""Tables of the frontier: chosen taxels, encoders and frames at equal rates."""

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


def _settings(point: Data) -> str:
    """Return taxels, bits and frame rate of a point in words."""
    kind, *numbers = point["readout"].split(":")
    words = f"{numbers[0]} b" if _kind(point["name"]) != "frame" else f"{numbers[0]} Hz, {numbers[1]} b"
    if kind == "frame-onoff":
        words += f", levels of {numbers[2] if len(numbers) > 2 else 4} b"
    return f"{len(point['taxels'])} x {words}"


def _by_budget(preset: str, network: str, cell: Any, first: int = 0) -> None:
    """Print a table with a row for each kind of readout, from the first on, and a column for each budget."""
    found = chosen(preset, network)
    kinds, budgets = (list(dict.fromkeys(part)) for part in zip(*found, strict=True))
    rows = [
        [filled("{kind:E}", {"kind": kind}), *(cell(found, kind, budget) for budget in budgets)]
        for kind in kinds[first:]
    ]
    table(["", *(f"at most {budget:,} events/s" for budget in budgets)], rows)


def frontier(preset: str, network: str) -> None:
    """Print accuracy and settings of the chosen readouts of a network."""

    def cell(found: Any, kind: str, budget: int) -> str:
        point = found[kind, budget]
        power = "" if point["power_w"] is None else filled(", {power_w:1e9*#2} nW", point)
        words = "**{accuracy:100*.1f} %**, {bits_per_s:1e-3*#3} kb/s{power}<br>{settings}"
        return filled(words, point | {"settings": _settings(point), "power": power})

    _by_budget(preset, network, cell)


def frontier_pairs(preset: str, network: str) -> None:
    """Print the differences of the chosen readouts to LCS, with intervals."""
    pairs = read("docs/data/frontier.json")["pairs"]

    def cell(found: Any, kind: str, budget: int) -> str:
        pair = only(pairs, first=found["lcs", budget]["name"], second=found[kind, budget]["name"])
        low, high = pair["interval"]
        return filled("**{row:+%}**" if low * high > 0 else "{row:+%}", pair)

    _by_budget(preset, network, cell, first=1)


def frontier_seeds() -> Rows:
    """Return every point with three seeds: the accuracy of each seed and the interval."""
    points = [point for point in read("docs/data/frontier.json")["points"] if point["seeds"] >= 3]
    return [
        point
        | {
            "of": NETWORKS[point["network"]] + (", bins of 4 ms" if point["network"] == "leaky" else ""),
            "settings": _settings(point),
            "kind": _kind(point["name"]),
            "each": ", ".join(f"{100 * value:.1f}" for value in point["accuracy_of_seeds"]),
        }
        for point in points
    ]


def frontier_latency(network: str, *budgets: int) -> None:
    """Print the accuracy of a network's physical scans over time, and its early answers."""
    rows = []
    for (kind, budget), point in chosen("physical", network).items():
        latency = point.get("latency")
        if budget not in budgets or latency is None:
            continue
        shown = [latency["accuracy"][number] for number in (3, 7, 11, 15, 19)]
        early = latency["early"]
        words = "none" if early is None else filled("{mean_s:1e3*.0f} ms: {accuracy:100*.1f} %", early)
        rows.append([f"{budget:,}", filled("{kind:E}", {"kind": kind}), *(f"{100 * one:.1f}" for one in shown), words])
    times = [f"{1e3 * at(LCS_LEAKY)['latency']['times_s'][number]:.0f} ms" for number in (3, 7, 11, 15, 19)]
    table(["events/s, at most", "readout", *times, "early answers: mean time, accuracy"], rows)


def against(kind: str) -> Data:
    """Return in how many comparisons a kind of readout is significantly more or less accurate than LCS."""
    data = read("docs/data/frontier.json")
    found = []
    for preset, network in dict.fromkeys((point["preset"], point["network"]) for point in data["points"]):
        for (one, budget), point in chosen(preset, network).items():
            if one == kind:
                first = chosen(preset, network)["lcs", budget]["name"]
                found.append(only(data["pairs"], first=first, second=point["name"])["interval"])
    more, less = (sum(low > 0 for low, _ in found), sum(high < 0 for _, high in found))
    return {"of": len(found), "more": more, "less": less}


def candidates() -> Data:
    """Count the readouts that inner validation compared, and the readouts that it chose."""
    inner = read("docs/data/frontier.json")["inner"]
    return {"tried": len(inner), "chosen": sum(one["chosen"] for one in inner)}


def less(first: str, second: str) -> Data:
    """Return the accuracy loss of the second point of a pair, with interval, and its relative power."""
    pair = only(read("docs/data/frontier.json")["pairs"], first=first, second=second)
    power = {"ratio": at(second)["power_w"] / at(first)["power_w"]} if at(second)["power_w"] else {}
    low, high = sorted(0.0 - bound for bound in pair["interval"])
    return {"lead": -pair["difference"], "low": low, "high": high, "a": at(first), "b": at(second)} | power


def best(preset: str, most_hz: int, network: str = "") -> Data:
    """Return the most accurate readout of an encoder with three seeds and at most so many events/s."""
    found = [
        point
        for point in read("docs/data/frontier.json")["points"]
        if point["preset"] == preset and point["network"] == (network or point["network"]) and point["seeds"] >= 3
        if point["rate_hz"] <= most_hz and _kind(point["name"]) != "frame"
    ]
    return max(found, key=lambda point: point["accuracy"])


def frontier_targets() -> Rows:
    """Yield targets and results of the frontier."""
    reached = "{verdict}: {row:%}, {what}, {rate_hz:,.0f} events/s"
    for words, point, least in (
        ("97.15 % at 2,200 events/s with at most 256 spiking neurons", best("physical", 2200, "leaky-2ms"), 0.9715),
        ("99 % at 2,200 events/s with the best network", best("physical", 2200), 0.99),
        ("97.15 % at 1,000 events/s with the best network", best("physical", 1000), 0.9715),
        ("92 % at 2,200 events/s on the `paper` scan, with the best network", best("paper", 2200), 0.92),
    ):
        what = filled("{kind:E} {settings}", {"kind": _kind(point["name"]), "settings": _settings(point)})
        what += f", {NETWORKS[point['network']]}"
        verdict = "met" if point["accuracy"] >= least else "missed"
        yield [words, filled(reached, point | {"verdict": verdict, "what": what})]
    chip = frontier_chip("nlcs-bipolar:2")
    verdict = "met" if chip["lead"] <= 0.01 else "missed"
    yield [
        "in the RTL chip with weights of 4 b, at most 1 point less than in float",
        filled(reached, chip | {"verdict": verdict, "what": "bipolar N-LCS 12 x 2 b"}),
    ]


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


def frontier_whole_arrays() -> Rows:
    """Return the points with all taxels, from sweeps of the paper's scan."""
    points = [p for p in read("docs/data/frontier.json")["points"] if p["choice"] == "all" and p["network"] != "leaky"]
    earlier = [point for point in points if "trivial" not in point]
    return [point | {"of": NETWORKS[point["network"]]} for point in earlier]
