"""Accuracies, by encoder, network and data rate."""

from __future__ import annotations

from typing import Any

from docs.tables.netlists import by_frames, measured_libraries
from docs.tables.rates import rates
from docs.tables.written import ENCODERS, ROOT, digits, markdown, percent, read, table


def published(readout: str, resolution: int) -> dict[str, Any]:
    """Return a point of the paper's Fig. 9."""
    points = read("snn/figures/published_fig9.json")["points"]
    (found,) = (p for p in points if (p["readout"], p["resolution"]) == (readout, resolution))
    return dict(found)


def sweep(name: str) -> list[dict[str, Any]]:
    """Return the points of a sweep, LCS first."""
    return sorted(read(f"snn/figures/sweeps/{name}.json")["points"], key=lambda p: (p["readout"], p["resolution"]))


def rate(point: dict[str, Any]) -> str:
    """Return a normalised data rate with three digits."""
    return digits(point["normalised_rate"], 3 if point["normalised_rate"] > 0.1 else 2)


@table
def accuracy_paper() -> str:
    """The paper's network on the paper's scans."""
    rows = [
        [
            f"{ENCODERS[p['readout']]} {p['resolution']} b",
            rate(p),
            f"{100 * published(p['readout'], p['resolution'])['accuracy']:.2f} %",
            percent(p["last"]),
            f"{100 * p['selected']['accuracy']:.1f} %",
        ]
        for p in sweep("paper-network")
    ]
    return markdown(["encoder", "normalised rate", "published", "last epoch", "selected epoch"], rows)


@table
def accuracy_physical() -> str:
    """The tuned network on physical scans, and its point with bins of 2 ms."""
    points = [(p, "") for p in sweep("tuned")] + [(p, ", bins of 2 ms") for p in sweep("tuned-2ms")]
    points.sort(key=lambda pair: (pair[0]["readout"], pair[0]["resolution"]))
    rows = [
        [
            f"{ENCODERS[p['readout']]} {p['resolution']} b{bins}",
            rate(p),
            percent(p["last"]),
            f"{100 * p['selected']['accuracy']:.1f} %",
        ]
        for p, bins in points
    ]
    return markdown(["encoder", "normalised rate", "last epoch", "selected epoch"], rows)


FRAME_NETWORKS = {"rnn": "ReLU units (`rnn`), the paper's baseline", "cnn": "1-D convolutions (`cnn`), the fair one"}


def frame_points() -> dict[str, dict[str, Any]]:
    """Return the points of frames by the kind of network."""
    points = sweep("reference-frames")
    return {kind: next(p for p in points if kind in p["name"]) for kind in FRAME_NETWORKS}


@table
def accuracy_frames() -> str:
    """Both baselines on frames."""
    rows = [
        [
            FRAME_NETWORKS[kind],
            f"{100 * published('frame', 10)['accuracy']:.2f} %" if kind == "rnn" else "",
            percent(p["last"]),
            f"{100 * p['selected']['accuracy']:.1f} %",
        ]
        for kind, p in frame_points().items()
    ]
    return markdown(["network", "published", "last epoch", "selected epoch"], rows)


@table
def accuracy_rates() -> str:
    """Readouts at equal data rate, by network."""
    data = read("docs/data/fig9_rates.json")
    networks = data["networks"]
    rows = [
        [
            networks[p["sweep"]],
            p["label"].split(", rates-")[0],
            f"{digits(p['normalised_rate'], 3)} ({digits(p['coded_rate'], 3)})",
            f"{100 * p['accuracy']:.1f} % ({100 * p['interval'][0]:.1f} to {100 * p['interval'][1]:.1f})",
            f"{p['seeds']} x 6",
        ]
        for p in sorted(data["points"], key=lambda p: (list(networks).index(p["sweep"]), p["normalised_rate"]))
    ]
    return markdown(["network", "readout", "normalised rate (coded)", "last epoch", "seeds x folds"], rows)


def p_value(p: float) -> str:
    """Return a p in two digits; one that is very small as a bound."""
    return digits(p, 2) if p >= 1e-3 else "< 0.001"


@table
def rates_pairs() -> str:
    """Frames against events of about the same rate, the same network, image by image."""
    rows = [
        [
            f"`{p['first']}`",
            f"`{p['second'].split(':')[1]}`",
            f"{100 * p['difference']:+.1f} ({100 * p['interval'][0]:+.1f} to {100 * p['interval'][1]:+.1f})",
            f"{sum(p['only_first'])}, {sum(p['only_second'])}",
            ", ".join(map(p_value, p["p"])),
        ]
        for p in read("docs/data/fig9_rates.json")["pairs"]
    ]
    head = ["A: events", "B: frames", "B - A, points", "only A right, only B right", "McNemar p by seed"]
    return markdown(head, rows)


@table
def results() -> str:
    """What a reader of the README wants to know first."""
    lcs, nlcs = ({p["resolution"]: p for p in sweep("paper-network") if p["readout"] == r} for r in ("lcs", "nlcs"))
    rows = [
        [
            f"events/s, {ENCODERS[p['encoding']]} {p['resolution']} b",
            f"{p['published_hz']:,.1f}",
            f"{p['here_hz']:,.1f}",
        ]
        for p in rates()
        if (p["encoding"], p["resolution"]) in (("lcs", 2), ("lcs", 6), ("nlcs", 8))
    ]
    for name, ours in (("LCS 6 b", lcs[6]), ("LCS 8 b", lcs[8]), ("N-LCS 8 b", nlcs[8])):
        theirs = published(ours["readout"], ours["resolution"])["accuracy"]
        rows.append([f"six textures, the paper's network, {name}", f"{100 * theirs:.2f} %", percent(ours["last"])])
    (best,) = sweep("tuned-2ms")
    rows.append([f"six textures, a leaky network, LCS 3 b at {rate(best)} of 640 kb/s", "", percent(best["last"])])
    frames = frame_points()
    theirs = published("frame", 10)["accuracy"]
    rows.append(["six textures from frames, ReLU units", f"{100 * theirs:.2f} %", percent(frames["rnn"]["last"])])
    rows.append(["six textures from frames, convolutions", "", percent(frames["cnn"]["last"])])
    for mode, text in (("paper", "in the paper's model"), ("consistent", "with seven corrections")):
        ratio = read("docs/data/fig7.json")["modes"][mode]["ratio"]
        value = f"{digits(ratio['lcs'][5], 3)} (LCS), {digits(ratio['nlcs']['0.2'][5], 3)} (N-LCS)"
        rows.append([f"power by that of frames, 6 b, 1 mV of noise, {text}", "", value])
    for library, cells in measured_libraries():
        parts = read(f"docs/data/asic/{library}/fig6.json")["modes"]["consistent"][1]
        value = f"{by_frames(parts, 'lcs')} (LCS), {by_frames(parts, 'nlcs')} (N-LCS)"
        rows.append([f"the same, the logic of all three measured on netlists in {cells} cells", "", value])
    return markdown(["", "published", "here"], rows)


@table
def nlcs_explained() -> str:
    """N-LCS with other constants, with OFF events, and LCS without; beside them the points of the paper's sweep."""
    texts = {
        "tau-0.02": "N-LCS 6 b, tau 20 ms",
        "start": "N-LCS 6 b, counted from 10 ms on",
        "bipolar-0.2": "bipolar N-LCS 4 b, tau 200 ms",
        "bipolar-0.05": "bipolar N-LCS 3 b, tau 50 ms",
        "on": "LCS 6 b, ON events alone",
    }
    found = []
    for name, text in texts.items():
        if (ROOT / f"docs/data/classifier/nlcs/{name}.json").is_file():
            (point,) = read(f"docs/data/classifier/nlcs/{name}.json")["points"]
            found.append((text, point))
    paper = {(p["readout"], p["resolution"]): p for p in sweep("paper-network")}
    for readout, bits in (("nlcs", 6), ("nlcs", 8), ("lcs", 4), ("lcs", 6)):
        found.append((f"{ENCODERS[readout]} {bits} b, as above", paper[readout, bits]))
    rows = [
        [
            text,
            rate(p),
            percent(p["last"]),
            f"{100 * p['selected']['accuracy']:.1f} %",
            f"{p['cells']['whole_seeds']} x 6",
        ]
        for text, p in sorted(found, key=lambda one: one[1]["normalised_rate"])
    ]
    return markdown(["readout", "normalised rate", "last epoch", "selected epoch", "seeds x folds"], rows)


@table
def nlcs_epochs() -> str:
    """Folds of N-LCS 8 b: the published ones, and ours in the last and in the best test epoch."""
    ours = read("docs/data/classifier/nlcs/test-epochs.json")["folds"]
    published_folds = (62.5, 82.5, 85.0, 87.5, 65.0, 75.0)
    rows = [["published", *(f"{value:g}" for value in published_folds), f"{sum(published_folds) / 6:.1f}"]]
    for key, text in (("last", "here, last epoch"), ("best", "here, best test epoch (no result)")):
        values = [100 * fold[key] for fold in ours]
        rows.append([text, *(f"{value:g}" for value in values), f"{sum(values) / len(values):.1f}"])
    return markdown(["%", *(f"fold {n}" for n in range(6)), "mean"], rows)
