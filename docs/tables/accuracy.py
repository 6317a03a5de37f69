"""Tables of accuracies by encoder, network, data rate, noise and time."""

from typing import Any

from docs.tables.finger import finger_level_values, finger_played
from docs.tables.frontier import BIPOLAR_LEAKY, FRAMES_LEAKY, LCS_LEAKY, at, frontier_chip
from docs.tables.power import power_rows
from docs.tables.verification import replayed
from docs.tables.write import Rows, filled, only, read, table

TEXTURES = "docs/data/classifier/"


def sweep(name: str) -> list[dict[str, Any]]:
    """Return the points of a sweep, LCS first, each with the published accuracy or None."""
    fig9 = {(p["readout"], p["resolution"]): p["accuracy"] for p in read("docs/data/published_fig9.json")["points"]}
    points = sorted(read(f"docs/data/sweeps/{name}.json")["points"], key=lambda p: (p["readout"], p["resolution"]))
    return [p | {"published": fig9.get((p["readout"], p["resolution"]))} for p in points]


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


def nlcs_explained() -> Rows:
    """Return accuracies of N-LCS with other constants or OFF events, of LCS without OFF events, and of the paper."""
    texts = {
        "tau-0.02": "N-LCS 6 b, tau 20 ms",
        "start": "N-LCS 6 b, counted from 10 ms on",
        "bipolar-0.2": "bipolar N-LCS 4 b, tau 200 ms",
        "on": "LCS 6 b, ON events alone",
    }
    points = [only(read(f"{TEXTURES}nlcs/{name}.json")["points"]) | {"text": text} for name, text in texts.items()]
    for point in sweep("paper-network"):
        if (point["readout"], point["resolution"]) in (("nlcs", 6), ("nlcs", 8), ("lcs", 4), ("lcs", 6)):
            points.append(point | {"text": filled("{readout:E} {resolution} b, as above", point)})
    return sorted(points, key=lambda p: p["normalised_rate"])


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
    yield filled("the paper's ReLU network, frames, 3,200 kb/s | {theirs} | {last:%}", frame_points()["rnn"])
    for name, words, theirs in (
        (BIPOLAR_LEAKY, "bipolar N-LCS 2 b, {rate_hz:,.0f} events/s", "97.15 % at 2,200 events/s (INTUITIVE chip)"),
        (LCS_LEAKY, "LCS 2 b, {rate_hz:,.0f} events/s", ""),
        (FRAMES_LEAKY, "frames", ""),
    ):
        few = f"leaky network, {{count}} taxels, {words} ({{bits_per_s:1e-3*.1f}} kb/s) | {theirs} | {{row:%}}"
        yield filled(few, at(name) | {"count": len(at(name)["taxels"])})
    rtl = "[in the RTL](docs/results/frontier.md#through-the-rtl-chip), weights of 4 b"
    rtl = f"leaky network, 12 taxels, bipolar N-LCS 2 b, {rtl} |  | {{row:%}}, {{mismatches}} mismatches"
    yield filled(rtl, frontier_chip("nlcs-bipolar:2"))
    finger = "[finger](docs/results/finger.md)"
    for name, of in (("lcs_7", "LCS 7 b"), ("nlcs_4", "N-LCS 4 b"), ("frame_12_22_9", "frames")):
        words = f"{finger}, other repetition, level kept, {of} ({{kbps:.2f}} kb/s) |  | {{repetition:.1f}} %"
        yield filled(words, finger_level_values()[name])
    played = f"{finger}, other repetition, {{name}}, classified by the RTL |  | "
    yield filled(played + "{right} of {labelled} (float: {right_float}), {mismatches} mismatches", finger_played())
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
    leaky = "six textures, a leaky network, LCS 3 b, {data_rate_bps:1e-3*.0f} kb/s |  | {last:%}"
    yield filled(leaky, only(sweep("tuned-2ms")))
    for kind, text in (("rnn", "ReLU units"), ("cnn", "convolutions")):
        yield filled(f"six textures from frames, {text} | {{theirs}} | {{last:%}}", frame_points()[kind])
    yield from power_rows()
    known = only(read(f"{TEXTURES}merits.json")["timing"], known_from="events")
    yield filled("time of a level crossing from events, median error |  | {median_s:1e6*.0f} us", known)
