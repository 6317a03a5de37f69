"""Tables of accuracies by encoder, network, data rate, noise and time."""

from typing import Any

from docs.tables.claims import compared, counted
from docs.tables.finger import finger_level_values
from docs.tables.frontier import BIPOLAR_LEAKY, FRAMES_LEAKY, FRAMES_OF_POWER, LCS_LEAKY, at, frontier_chip
from docs.tables.power import power_rows
from docs.tables.verification import replayed
from docs.tables.write import Rows, filled, only, read, table
from eskin.snn.experiments.pairs import Answers, common_answers, right_of

TEXTURES = "docs/data/classifier/"


def sweep(name: str) -> list[dict[str, Any]]:
    """Return the points of a sweep, LCS first, each with the published accuracy or None."""
    fig9 = {(p["readout"], p["resolution"]): p["accuracy"] for p in read("docs/data/published_fig9.json")["points"]}
    points = sorted(read(f"docs/data/sweeps/{name}.json")["points"], key=lambda p: (p["readout"], p["resolution"]))
    return [p | {"published": fig9.get((p["readout"], p["resolution"]))} for p in points]


def published_claims() -> dict[str, str]:
    """Return the readouts whose published accuracy is below, inside or above our 95 % interval."""
    found: dict[str, list[str]] = {"below": [], "inside": [], "above": []}
    for point in sweep("paper-network"):
        low, high = point["last"]["bootstrap_95"]
        where = "below" if point["published"] < low else "above" if point["published"] > high else "inside"
        found[where].append(filled("{readout:E} {resolution} b", point))
    return {where: ", ".join(names) or "none" for where, names in found.items()}


def accuracy_physical() -> Rows:
    """Return accuracies of the tuned network on scans of preset ``physical``."""
    points = [p | {"bins": ""} for p in sweep("tuned")] + [p | {"bins": ", bins of 2 ms"} for p in sweep("tuned-2ms")]
    return sorted(points, key=lambda p: (p["readout"], p["resolution"]))


def frame_points() -> dict[str, dict[str, Any]]:
    """Return the points of frames by kind of network."""
    published = only(read("docs/data/published_fig9.json")["points"], readout="frame", resolution=10)["accuracy"]
    rnn, cnn = (next(p for p in sweep("reference-frames") if kind in p["name"]) for kind in ("rnn", "cnn"))
    return {
        "rnn": rnn | {"text": "ReLU units (`rnn`), as in the paper", "theirs": f"{100 * published:.2f} %"},
        "cnn": cnn | {"text": "1-D convolutions (`cnn`)", "theirs": ""},
    }


NLCS = {
    "tau-0.02": "N-LCS 6 b, tau 20 ms",
    "start": "N-LCS 6 b, counted from 10 ms on",
    "bipolar-0.2": "bipolar N-LCS 4 b, tau 200 ms",
    "on": "LCS 6 b, ON events alone",
}
"""Trainings with other constants or without OFF events (docs/data/classifier/nlcs)."""


def nlcs_explained() -> Rows:
    """Return accuracies of N-LCS with other constants or OFF events, of LCS without OFF events, and of the paper."""
    points = [only(read(f"{TEXTURES}nlcs/{name}.json")["points"]) | {"text": text} for name, text in NLCS.items()]
    for point in sweep("paper-network"):
        if (point["readout"], point["resolution"]) in (("nlcs", 6), ("nlcs", 8), ("lcs", 4), ("lcs", 6)):
            points.append(point | {"text": filled("{readout:E} {resolution} b, as above", point)})
    return sorted(points, key=lambda p: p["normalised_rate"])


def nlcs_claims() -> Rows:
    """Yield comparisons of the readouts of ``nlcs_explained``, with the networks of seed 0."""
    points = {name: only(read(f"{TEXTURES}nlcs/{name}.json")["points"]) for name in NLCS}
    texts = dict(NLCS)
    for point in read(f"{TEXTURES}nlcs/seed-0.json")["points"]:
        points[point["name"]] = point
        texts[point["name"]] = filled("{readout:E} {resolution} b", point)
    pairs = [("lcs-4", "nlcs-6"), ("lcs-6", "nlcs-8"), ("nlcs-6", "tau-0.02"), ("nlcs-6", "start")]
    pairs += [("lcs-6", "on"), ("lcs-4", "bipolar-0.2")]
    words = {name: point["last"]["predictions"] for name, point in points.items()}
    answers = {(a, b): Answers(points[a]["labels"], words[a], words[b]) for a, b in pairs}
    for (a, b), claim in compared(answers).items():
        yield {"first": texts[a], "second": texts[b]} | claim._asdict()


def early() -> Rows:
    """Return the results of early decisions by margin, and of all bins."""
    report = read(f"{TEXTURES}early.json")
    return [row | {"text": f"{row['margin']:,}"} for row in report["margins"]] + [report["whole"] | {"text": "none"}]


def early_values() -> dict[str, Any]:
    """Return the fastest early decisions that are right as often as any, and the results of all bins."""
    report = read(f"{TEXTURES}early.json")
    best = max(report["margins"], key=lambda row: (row["right"], -row["mean_s"]))
    return {"best": best, "fast": best["mean_s"], "whole": report["whole"]}


def delays() -> Rows:
    """Yield comparisons of networks whose inputs are repeated with delays with networks without delays."""
    report = read(f"{TEXTURES}delays.json")
    answers = {
        (task["task"], name): Answers(task["labels"], task["predictions"]["none"], words)
        for task in report["tasks"]
        for name, words in task["predictions"].items()
        if name != "none"
    }
    for (task, name), claim in compared(answers).items():
        labels, *both = answers[task, name]
        plain, late = (", ".join(str(n) for n in right_of(labels, words).sum(axis=1)) for words in both)
        row = {"task": task, "delays": name.replace(" ", ", "), "images": len(labels), "plain": plain, "late": late}
        yield row | claim._asdict()


def nir_networks() -> None:
    """Print the agreement of integer networks with float networks from other programs."""
    report = read(f"{TEXTURES}nir.json")
    bits = [point["bits"] for point in report["networks"][0]["points"]]
    rows = [
        [one["network"], *(f"{100 * point['same'] / one['scans']:.1f}" for point in one["points"])]
        for one in report["networks"]
    ]
    table(["scans with the same class, %", *(f"{n} b" for n in bits)], rows)
    rtl = {name: sum(one["rtl"][name] for one in report["networks"]) for name in ("clocks", "events", "bins")}
    first = report["networks"][0]
    print(
        f"`{report['command']}`, commit {report['commit']}, {report['date']}: {first['scans']} scans of "
        f"{first['bins']} bins; in the RTL {rtl['clocks']:,} clocks, {rtl['events']:,} events, "
        f"{rtl['bins']:,} bins, 0 mismatches.\n"
    )


def robustness() -> Rows:
    """Return the accuracy of both networks under every disturbance, in %."""
    rows: dict[str, dict[str, Any]] = {}
    for point in read(f"{TEXTURES}robustness.json")["points"]:
        name = point["disturbance"]
        name += "" if name == "clean" else f" {point['strength']:g}"
        rows.setdefault(name, {"name": name})[point["network"]] = point
    return rows.values()


def robustness_claims() -> dict[str, Any]:
    """Return in which disturbances the robust network is significantly more accurate than the clean one, and counts."""
    rows = {row["name"]: row for row in robustness()}
    claims = compared({name: common_answers(row["clean"], row["robust"]) for name, row in rows.items()})
    better = [name for name, claim in claims.items() if claim.verdict == "more"]
    return counted(claims.values()) | {"better": ", ".join(better)}


def latency_claims() -> dict[str, Any]:
    """Count the comparisons of LCS 4 b with frames after parts of a touch; ``times`` are the significant ones in ms."""
    points = read(f"{TEXTURES}merits.json")["latency"]
    times = {point["time_s"] for point in points}
    at = {s: [only(points, network=name, time_s=s) for name in ("lcs-4", "frame-onoff")] for s in sorted(times)}
    claims = compared({time_s: common_answers(*pair) for time_s, pair in at.items()})
    significant = [f"{1e3 * time_s:g}" for time_s, claim in claims.items() if claim.verdict]
    return {"of": len(claims), "significant": len(significant), "times": ", ".join(significant)}


MODES = ("paper", "consistent")
"""Modes of docs/data/classifier/noise_power.json: white noise, and noise below 97 Hz."""


def noise_claims() -> Rows:
    """Yield a row for each network: the noises at which it is significantly less accurate than at the lowest noise.

    The last row has the noises at which frames are more accurate than LCS 4 b. All rows are one list of comparisons.
    """
    points = {(p["network"], p["mode"], p["noise_v"]): p for p in read(f"{TEXTURES}noise_power.json")["points"]}
    low = min(noise_v for *_, noise_v in points)
    pairs = {key: (points[*key[:2], low], point) for key, point in points.items() if key[2] > low}
    for key in [key for key in points if key[0] == "frame-onoff"]:
        pairs["frames", *key[1:]] = points["lcs-4", *key[1:]], points[key]
    answers = {key: common_answers(*pair) for key, pair in pairs.items()}
    claims = compared(answers)
    for name in dict.fromkeys(name for name, *_ in pairs):
        text, way = name, "less"
        if name == "frames":
            text, way = "frames more accurate than LCS 4 b", "more"
        own = {key[1:]: claim.verdict for key, claim in claims.items() if key[0] == name}
        images = next(len(answer.labels) for key, answer in answers.items() if key[0] == name)
        found = [[f"{1e3 * v:g}" for (of, v), verdict in own.items() if (of, verdict) == (mode, way)] for mode in MODES]
        yield [text, str(images), *(", ".join(one) or "none" for one in found)]


def noise_powers() -> dict[str, float]:
    """Return the power of LCS 4 b and N-LCS 6 b, divided by that of frames, at 1 mV and (``paper_3``) 3 mV of noise."""
    points = {(p["network"], p["mode"], p["noise_v"]): p for p in read(f"{TEXTURES}noise_power.json")["points"]}

    def ratio(network: str, mode: str, noise_v: float) -> float:
        found, frames = (points[name, mode, noise_v]["power_w"]["total"] for name in (network, "frame-onoff"))
        return float(found / frames)

    return {
        "paper_1": ratio("lcs-4", "paper", 1e-3),
        "paper_3": ratio("lcs-4", "paper", 3e-3),
        "lcs": ratio("lcs-4", "consistent", 1e-3),
        "nlcs": ratio("nlcs-6", "consistent", 1e-3),
    }


def integer_claims() -> Rows:
    """Yield, for weights of 8, 4 and 3 bits, how many integer networks are more or less accurate than in float.

    ``most`` is the largest loss. The list has all networks that were trained with float weights. The last row compares
    networks of 4 bits that were trained with rounded weights with those that were not.
    """
    report = read(f"{TEXTURES}precision.json")
    points = {(point["network"], point["variant"]): point for point in report["points"]}
    answers = {}
    for network, variant in points:
        if "-qat" not in network and variant in ("8", "4", "3"):
            answers[f"weights of {variant} b instead of float", network] = (network, "float"), (network, variant)
        if "-qat4" in network and variant == "4":
            answers["4 b, trained with rounded weights or not", network] = (network.removesuffix("-qat4"), "4"), (
                network, "4")  # fmt: skip
    claims = compared({key: _of_tests(report, *(points[one] for one in pair)) for key, pair in answers.items()})
    for what in dict.fromkeys(what for what, _ in claims):
        own = [claim for (text, _), claim in claims.items() if text == what]
        yield {"what": what, "most": -min(claim.difference for claim in own)} | counted(own)


def _of_tests(report: dict[str, Any], first: dict[str, Any], second: dict[str, Any]) -> Answers:
    """Return the predictions of two networks at some precision, all tests as one seed."""
    labels = [test["labels"] for test in report["tests"][first["network"]]]
    assert labels == [test["labels"] for test in report["tests"][second["network"]]]
    return Answers("".join(labels), *(["".join(point["predicted"])] for point in (first, second)))


def merits_rest() -> Rows:
    """Yield the data rate during a moving and a resting touch, as sent and compressed."""
    data = read(f"{TEXTURES}merits.json")["rest"]
    columns = (("moving", 0.0), ("resting", 0.0), ("resting", 0.001), ("resting", 0.01))
    for readout in dict.fromkeys(row["readout"] for row in data):
        found = (only(data, readout=readout, phase=phase, noise_v=noise) for phase, noise in columns)
        yield [f"`{readout}`", *(filled("{sent_bps:1e-3*.2f} / {coded_bps:1e-3*.2f}", row) for row in found)]


def touch() -> Rows:
    """Return data rate and data volume of each step from touch to class."""
    report = read("docs/data/touch.json")
    chip = report["chip"]
    taxels = chip["rows"] * chip["columns"]
    seconds = report["clocks"] / (chip["sample_rate_hz"] * chip["clocks_per_sample"])
    bits = (taxels - 1).bit_length() + 1
    values = {
        **report,
        **chip,
        "taxels": taxels,
        "bits": bits,
        "sampled": taxels * chip["sample_rate_hz"] * chip["sample_bits"],
        "rate": report["events"] / seconds,
        "sent": report["events"] / seconds * bits,
        "adds": report["additions"] / seconds,
        "late": report["latency_clocks"] * seconds / report["clocks"],
        "waiting": report["stalls"] / report["clocks"],
    }
    lines = """\
samples | {taxels} x {sample_bits} b at {sample_rate_hz:1e-3*g} kHz | {sampled:1e-6*.1f} Mb/s
address events | {rate:,.0f} events/s of {bits} b | {sent:1e-3*.0f} kb/s
network | {classifier_hidden} neurons, weights of {classifier_rec_bits} b | {adds:1e-6*.1f} M additions/s
class | one class every {classifier_bin_s:1e3*g} ms | latency: at most {late:1e6*.0f} us after the end of the time bin
images right | {right} of {labelled} in the RTL, one network per fold | {right_float} of {labelled} before rounding
stalls | the readout waits for the classifier in {waiting:.0%} of the clocks | """
    return [filled(line, values) for line in lines.splitlines()]


def headline() -> Rows:
    """Yield the main results, for the README."""
    yield filled("equal events of RTL and model ({images} scans, four encoders) |  | {events:,}", replayed())
    paper = only(sweep("paper-network"), readout="lcs", resolution=6)
    yield filled("the paper's network, LCS 6 b | {published:100*.2f} % | {last:%}", paper)
    for name, words, theirs in (
        (BIPOLAR_LEAKY, "bipolar N-LCS 2 b, {rate_hz:,.0f} events/s", "97.15 % at 2,200 events/s (INTUITIVE chip)"),
        (LCS_LEAKY, "LCS 2 b, {rate_hz:,.0f} events/s", ""),
        (FRAMES_LEAKY, "frames, {share:.2f} of the power of this LCS", ""),
        (FRAMES_OF_POWER, "frames, {share:.2f} of the power of this LCS", ""),
    ):
        few = f"leaky network, {{count}} taxels, {words} ({{bits_per_s:1e-3*.1f}} kb/s) | {theirs} | {{row:%}}"
        point, share = at(name), (at(name)["power_w"] or 0) / at(LCS_LEAKY)["power_w"]
        yield filled(few, point | {"count": len(point["taxels"]), "share": share})
    rtl = "[in the RTL](docs/results/frontier.md#through-the-rtl-chip), weights of 4 b"
    rtl = f"leaky network, 12 taxels, bipolar N-LCS 2 b, {rtl} |  | {{row:%}}, {{mismatches}} mismatches"
    yield filled(rtl, frontier_chip("nlcs-bipolar:2"))
    finger = "[finger](docs/results/finger.md)"
    for name, of in (("lcs_7", "LCS 7 b"), ("nlcs_4", "N-LCS 4 b"), ("frame_12_22_9", "frames")):
        words = f"{finger}, other repetition, level kept, {of} ({{kbps:.2f}} kb/s) |  | {{repetition:.1f}} %"
        yield filled(words, finger_level_values()[name])
    yield from power_rows()[:2]


def results() -> Rows:
    """Yield our results beside the published ones."""
    for rate in read("docs/data/event_rates.json")["points"]:
        if (rate["encoding"], rate["resolution"]) in (("lcs", 2), ("lcs", 6), ("lcs", 8), ("nlcs", 8)):
            yield filled("events/s, {encoding:E} {resolution} b | {published_hz:,.1f} | {here_hz:,.1f}", rate)
    network = "six textures, the paper's network, {readout:E} {resolution} b | {published:100*.2f} % | {last:%}"
    for point in sweep("paper-network"):
        if (point["readout"], point["resolution"]) in (("lcs", 6), ("lcs", 8), ("nlcs", 8)):
            yield filled(network, point)
    yield from power_rows()[:2]
    known = only(read(f"{TEXTURES}merits.json")["timing"], known_from="events")
    yield filled("time of a level crossing from events, median error |  | {median_s:1e6*.0f} us", known)
