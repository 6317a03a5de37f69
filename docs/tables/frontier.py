"""Tables of the frontier: chosen taxels, encoders and frames at equal rates."""

import itertools
from functools import cache
from typing import Any

from docs.tables.claims import Claim, compared, counted
from docs.tables.write import Rows, filled, only, read, table
from eskin.snn.experiments.pairs import Answers, compare

LCS_LEAKY = "physical/leaky-2ms/lcs:2/12x16:across:12"
BIPOLAR_LEAKY = "physical/leaky-2ms/nlcs-bipolar:2/12x16:across:12"
FRAMES_LEAKY = "physical/leaky-2ms/frame-onoff:250:3:2/12x16:across:12"
FRAMES_OF_POWER = "physical/leaky-2ms/frame-onoff:250:8:6/12x16:across:12"
"""Points of the frontier in the README and in sentences of docs/results/frontier.md."""

NETWORKS = {"leaky": "leaky", "leaky-2ms": "leaky", "convolutions": "convolutions", "paper": "the paper's"}

CHANGES = {"hidden": "hidden neurons", "dropout": "dropout", "drop_taxels": "taxels left out"}
"""Settings of the networks with more scans, in words."""

SAND, STONE = "3", "5"
"""Classes in the stored answers."""

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


POWER_FACTOR = 1.5
"""Powers of readouts that are compared at the same power differ by at most this factor."""


def _answers(first: Data, second: Data) -> Answers:
    return Answers(first["labels"], first["predictions"], second["predictions"])


@cache  # several documents need them
def against_lcs() -> dict[tuple[str, str], Claim]:
    """Return the comparisons of LCS with every other chosen readout at the same event rate, by their names."""
    answers = {}
    for preset, network in TRAININGS:
        found = chosen(preset, network)
        for (kind, budget), point in found.items():
            if kind != "lcs":
                lcs = found["lcs", budget]
                answers[lcs["name"], point["name"]] = _answers(lcs, point)
    return compared(answers)


def against(kind: str) -> dict[str, int]:
    """Return in how many comparisons a kind of readout is significantly more or less accurate than LCS."""
    return counted(claim for (_, name), claim in against_lcs().items() if _kind(name) == kind)


def frames_at_data_rate() -> Data:
    """Count the comparisons of LCS with frames, ``below`` and ``above`` the highest significant data rate ``kbps``."""
    frames = {names: claim for names, claim in against_lcs().items() if _kind(names[1]) == "frame"}
    kbps = max(1e-3 * at(lcs)["bits_per_s"] for (lcs, _), claim in frames.items() if claim.verdict)
    above = sum(1e-3 * at(lcs)["bits_per_s"] > kbps for lcs, _ in frames)
    return counted(frames.values()) | {"kbps": kbps, "above": above, "below": len(frames) - above}


def frames_at_power() -> Data:
    """Count the comparisons of chosen LCS with chosen frames of about the same power."""
    answers = {}
    for preset, network in TRAININGS:
        points = chosen(preset, network)
        for first, second in itertools.product(points.items(), points.items()):
            (kind, _), lcs = first
            (other, _), frames = second
            if (kind, other) == ("lcs", "frame"):
                ratio = frames["power_w"] / lcs["power_w"]
                if 1 / POWER_FACTOR <= ratio <= POWER_FACTOR:
                    answers[lcs["name"], frames["name"]] = _answers(lcs, frames)
    return counted(compared(answers).values()) | {"factor": POWER_FACTOR}


WHOLE_ARRAYS = [
    ("convolutions", "lcs:2", "frame-diff:31.25:8"),
    ("convolutions", "lcs:4", "frame-diff:250:8"),
    ("paper", "lcs:2", "frame-onoff:31.25:8"),
    ("paper", "lcs:4", "frame-onoff:250:8"),
]
"""Network, LCS and frames of all 64 taxels that are compared on ``paper`` scans."""


def whole_arrays() -> dict[str, int]:
    """Count the comparisons of LCS with frames of all taxels."""
    pairs = [[at(f"paper/{network}/{name}/all") for name in names] for network, *names in WHOLE_ARRAYS]
    return counted(compared({number: _answers(*points) for number, points in enumerate(pairs)}).values())


def frontier() -> None:
    """Print accuracy, data rate and power of LCS and frames for every scan, network and limit."""
    rows, marked = [], {name for (_, name), claim in against_lcs().items() if claim.verdict}
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


def _with_more_scans() -> list[Data]:
    """Return the inner validations of the readouts that were tried with more scans of each image."""
    networks = read("docs/data/frontier.json")["training"]["networks"]["physical"]
    more = [name for name, settings in networks.items() if "start_rows" in settings]
    return [one for one in read("docs/data/frontier.json")["inner"] if one["name"].split("/")[1] in more]


def more_scans() -> Rows:
    """Yield a row for each readout that was tried with more scans of each image."""
    data, steps = read("docs/data/frontier.json"), read("docs/data/steps.json")
    networks, points = data["training"]["networks"]["physical"], {one["name"]: one for one in data["points"]}
    for one in _with_more_scans():
        _, network, readout, choice = one["name"].split("/")
        skin, _, taxels = choice.split(":")
        kind, bits = _kind(one["name"]), readout.split(":")
        size = f"{bits[2]} b, {bits[1]} Hz" if kind == "frame" else f"{bits[1]} b"
        line = filled("{kind:E}, {taxels} x {bits}", {"kind": kind, "taxels": taxels, "bits": size})
        line += f", {skin.replace('x', ' x ')} taxels" if skin != "12x16" else ""
        changed = {key: value for key, value in networks[network].items() if value != networks["leaky-96"].get(key)}
        line += "".join(f", {CHANGES[key]} {value}" for key, value in changed.items())
        yield _tried(line, one, points.get(one["name"]))
    for number, rule in enumerate(steps["rules"]):
        line = filled("LCS, 12 taxels, step of {step:.0f} codes", rule)
        if rule["growth"] > 1:
            line += filled(", x {growth} at an event for {shrinks_s:1e3*.0f} ms", rule)
        yield _tried(line, rule, steps["test"] if number == steps["chosen"] else None)


def _tried(line: str, one: Data, test: Data | None) -> str:
    line += filled(" | {rate_hz:,.0f} | {learned:100*.1f} % | {of_scans:100*.1f} % | ", one)
    return line + (filled("{of_scans:100*.1f} % | {row:%} | {seeds}", test) if test else " |  | ")


def more_scans_values() -> Data:
    """Return the readouts that were chosen with more scans of each image, and compare them.

    ``few``: comparisons with the readouts chosen with 24 scans. ``rivals``: comparisons of bipolar N-LCS with LCS and
    frames, all with 96 scans.
    """
    points = {(_kind(one["name"]), one["budget_hz"]): at(one["name"]) for one in _with_more_scans() if one["chosen"]}
    before, bipolar = chosen("physical", "leaky-2ms"), points["nlcs-bipolar", 2200]
    few = compared({key: _answers(before[key], point) for key, point in points.items()})
    rivals = compared({kind: _answers(points[kind, 2200], bipolar) for kind in ("lcs", "frame")})
    errors = [
        {label, answer}
        for (kind, _), point in points.items()
        if kind == "nlcs-bipolar"
        for word in point["predictions"]
        for label, answer in zip(point["labels"], word, strict=True)
        if label != answer
    ]
    return {
        "few": _significant(few),
        "rivals": _significant(rivals),
        "best": bipolar,
        "low": points["nlcs-bipolar", 1000],
        "steps": read("docs/data/steps.json"),
        "errors": len(errors),
        "confused": errors.count({SAND, STONE}),
    }


def _significant(claims: dict[Any, Claim]) -> Data:
    found = counted(claims.values())
    return {"of": found["of"], "count": found["more"] + found["less"], "p": [claim.p for claim in claims.values()]}


def power_of_frames() -> float:
    """Return the power of frames at 2,200 events/s, leaky neurons, as a share of that of LCS."""
    return float(at(FRAMES_LEAKY)["power_w"] / at(LCS_LEAKY)["power_w"])


def candidates() -> Data:
    """Count the readouts that inner validation compared, and the readouts that it chose.

    ``most`` is the largest event rate of a chosen encoder, as a multiple of the rate in the title of its column.
    """
    inner = read("docs/data/frontier.json")["inner"]
    own = [one for one in inner if one["chosen"]]
    most = max(one["rate_hz"] / one["budget_hz"] for one in own if _kind(one["name"]) != "frame")
    return {"tried": len(inner), "chosen": len(own), "most": most}


FLOAT_LEAKS = "those of the float network"


@cache  # each takes a second, and several documents need them
def frontier_chip(readout: str, network: str = "leaky-2ms", leaks: str = FLOAT_LEAKS) -> Data:
    """Return the result of an RTL chip with chosen taxels, summed over its seeds, and what float weights add.

    ``lead`` is the accuracy of the float network of the frontier minus that of the chip.
    """
    found = only(read("docs/data/frontier_chip.json")["runs"], readout=readout, network=network, leaks=leaks)
    sums = {key: sum(one[key] for one in found["of_seeds"]) for key in found["of_seeds"][0]}
    float_network = at(f"physical/{network}/{readout}/12x16:across:12")
    pair = compare(found["labels"], found["predictions"], float_network["predictions"])
    interval = {"low": pair.interval[0], "high": pair.interval[1]}
    return found | sums | {"lead": pair.difference, "a": float_network} | interval


def _chips() -> list[Data]:
    runs = read("docs/data/frontier_chip.json")["runs"]
    return [frontier_chip(run["readout"], run["network"], run["leaks"]) for run in runs]


def frontier_chips() -> Rows:
    """Yield a row for each RTL chip with chosen taxels."""
    line = "{kind:E}, {leaks} | {scans} | {chip[classifier_in_bits]} b | {rate_hz:,.0f} | {right} of {images} | "
    line += "{row:%} | {a[accuracy]:100*.1f} % | {gain:+%} | {mismatches} of {events:,}"
    training = read("docs/data/frontier.json")["training"]
    for chip in _chips():
        more = {
            "kind": _kind(chip["a"]["name"]),
            "scans": (training["scans"]["physical"] | training["networks"]["physical"][chip["network"]])["start_rows"],
            "gain": {"difference": 0 - chip["lead"], "interval": [-chip["high"], -chip["low"]]},
        }
        yield filled(line, chip | more)


def chips_compared() -> Data:
    """Count the comparisons of the chips with their float networks, with fewer scans, and of bipolar N-LCS with LCS."""
    answers = {chip["a"]["name"] + chip["leaks"]: _answers(chip["a"], chip) for chip in _chips()}
    bipolar = frontier_chip("nlcs-bipolar:2")
    answers["lcs"] = _answers(frontier_chip("lcs:2"), bipolar)
    answers["scans"] = _answers(bipolar, frontier_chip("nlcs-bipolar:2", "leaky-96"))
    found = counted(compared(answers).values())
    return found | {"significant": found["more"] + found["less"]}
