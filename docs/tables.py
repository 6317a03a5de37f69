"""Write the tables of results into the documents, from the data: ``python docs/tables.py``.

A table stands between ``<!-- table NAME -->`` and ``<!-- end -->``, in any document and any number of times; NAME is
that of a function below. Data: ``docs/data``, ``snn/figures`` and ``benchmarks/results``.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"(<!-- table ([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)
ENCODERS = {"lcs": "LCS", "cw-lcs": "CW-LCS", "nlcs": "N-LCS"}

TABLES: dict[str, Callable[[], str]] = {}


def table(build: Callable[[], str]) -> Callable[[], str]:
    """Register a table under the name of its function, with hyphens."""
    TABLES[build.__name__.replace("_", "-")] = build
    return build


def read(path: str) -> Any:
    """Return the content of a JSON file, by its path from the top of the project."""
    return json.loads((ROOT / path).read_text())


def markdown(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table as text."""
    head = list(head)
    lines = ["| " + " | ".join(cells) + " |" for cells in [head, *map(list, rows)]]
    return "\n".join([lines[0], "|" + "---|" * len(head), *lines[1:]]) + "\n"


def digits(value: float, count: int) -> str:
    """Return a number with so many significant digits, and never in powers of ten."""
    text = f"{value:#.{count}g}"
    return (f"{value:.0f}" if "e" in text else text).removesuffix(".")


def percent(points: dict[str, Any]) -> str:
    """Return an accuracy with its 95 % interval over images and seeds, in per cent."""
    low, high = (100 * bound for bound in points["bootstrap_95"])
    return f"{100 * points['accuracy']:.1f} % ({low:.1f} to {high:.1f})"


# -- event rates -----------------------------------------------------------------------------------


def rates() -> list[dict[str, Any]]:
    """Return the rates that the paper gives, beside ours: Kylberg, ``paper``, N-LCS with 200 ms."""
    return list(read("docs/data/event_rates.json")["points"])


def stored_hz(encoding: str, resolution: int) -> float:
    """Return the same rate of the array from the rates of its taxels that the power model reads."""
    stored = read("model/power/event_rates.json")["tables"][0]
    assert (stored["dataset"], stored["preset"]) == ("kylberg", "paper")
    of_resolution = stored["lcs_hz"] if encoding == "lcs" else stored["nlcs_hz"][stored["taus_s"].index(0.2)]
    return float(sum(of_resolution[stored["resolutions"].index(resolution)]))


@table
def event_rates() -> str:
    """Published rates, those of float samples, and ours."""
    rows = [
        [f"{ENCODERS[point['encoding']]} {point['resolution']} b"]
        + [f"{point[name]:,.1f}" for name in ("published_hz", "float_samples_hz", "here_hz")]
        + [f"{100 * (point['here_hz'] / point['published_hz'] - 1):+.2f} %"]
        for point in rates()
    ]
    return markdown(["readout", "published", "float samples", "here (integer)", "difference"], rows)


# -- accuracy --------------------------------------------------------------------------------------


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


# -- what events are good for ----------------------------------------------------------------------


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


# -- power -----------------------------------------------------------------------------------------


@table
def power_parts() -> str:
    """Fig. 6, mode ``paper``, at the least and the most noise."""
    data = read("docs/data/fig6.json")
    names = {"nlcs": "N-LCS", "lcs": "LCS", "frame": "frame"}
    rows = [
        [f"{1e3 * data['noise_v_rms'][i]:g} mV", names[readout]]
        + [f"{data['modes']['paper'][i][readout][part]:.3e}" for part in ("afe", "converter", "io", "total")]
        for i in (0, 2)
        for readout in names
    ]
    return markdown(["v_n", "readout", "AFE", "converter", "I/O", "total"], rows)


def by_resolution(values: dict[str, Any], show: Callable[[float | None], str]) -> str:
    """Return a table of LCS and of N-LCS with its time constants over the resolutions."""
    named = {"LCS": values["lcs"]}
    named |= {f"N-LCS {1e3 * float(tau_s):.0f} ms": row for tau_s, row in values["nlcs"].items()}
    return markdown(["N", *map(str, range(1, 11))], [[name, *map(show, row)] for name, row in named.items()])


@table
def power_crossover() -> str:
    """Crossover in mV, mode ``paper``."""
    values = read("docs/data/fig7.json")["modes"]["paper"]["crossover"]
    return by_resolution(values, lambda v: "-" if v is None else digits(1e3 * v, 4))


@table
def power_ratio() -> str:
    """Spiking over frame power at 1 mV, mode ``consistent``."""
    values = read("docs/data/fig7.json")["modes"]["consistent"]["ratio"]
    return by_resolution(values, lambda v: digits(float(v or 0), 3))


@table
def power_sensitivity() -> str:
    """Every correction alone, all but one, and the variants."""
    data = read("docs/data/sensitivity.json")
    rows = []
    for row in data["rows"]:
        bold = "**" if row["case"] == "all (consistent)" else ""
        cells = [row["case"]]
        for readout in ("nlcs", "lcs"):
            crossing = row["crossover"][readout]
            noise = crossing["noise_v_rms"]
            cells += [f"{ratio:.3g}" for ratio in row["ratio"][readout]]
            cells.append(crossing["spikes_win"] + ("" if noise is None else f" {digits(1e3 * noise, 3)}"))
        rows.append([f"{bold}{cell}{bold}" for cell in cells])
    noises = [f"{1e3 * noise:.3g} mV" for noise in data["noise_v_rms"]]
    columns = [[f"{name} {noises[0]}", *noises[1:], "spikes win"] for name in ("N-LCS", "LCS")]
    return markdown(["corrections", *columns[0], *columns[1]], rows)


def energy(result: dict[str, Any], name: str) -> str:
    """Return an energy of a result in picojoules, a dash where it has none."""
    value = result.get(f"energy_per_{name}event_j")
    return "-" if value is None else f"{1e12 * value:.2f}"


def netlists() -> dict[str, dict[str, Any]]:
    """Return the reports of ``make asic`` that are kept, by name: libraries apart, then by size and readout."""
    found = {}
    for path in (ROOT / "docs/data/asic").glob("*-*x*-*.json"):
        report = json.loads(path.read_text())
        kept = report["configuration"]  # where no power was measured the report has it there alone
        names = {"readout": kept.get("encoding", "frame"), "process": report["library"], "frontend": ""}
        found[path.stem] = names | {name: kept.get(name) for name in ("rows", "columns", "frontend")} | report

    def order(item: tuple[str, dict[str, Any]]) -> tuple[Any, ...]:
        report = item[1]
        names = ["lcs", "cw-lcs", "nlcs", "frame"]
        return (report["library"], report["rows"], names.index(report["readout"]), report["frontend"])

    return dict(sorted(found.items(), key=order))


def cells_of(result: dict[str, Any]) -> str:
    """Return what the cells of a result are."""
    return {"sg13g2": "IHP 130 nm"}.get(result["process"].split("_")[0], "OSU 180 nm")


def named(result: dict[str, Any]) -> str:
    """Return the readout of a result in words."""
    return " ".join([(ENCODERS | {"frame": "frames"})[result["readout"]], result["frontend"]]).strip()


@table
def asic_netlists() -> str:
    """What netlists are made of, how fast they are, and what is proved of them."""
    rows = []
    for report in netlists().values():
        fmax, path = report["fmax_hz"], report["timing"]["typical"]["logic_depth"]
        corners = [fmax[corner] for corner in ("slow", "typical", "fast") if corner in fmax]
        rows.append(
            [
                named(report),
                f"{report['rows']} x {report['columns']}",
                cells_of(report),
                f"{report['area_um2_per_taxel']:,.0f}",
                f"{100 * report['sequential_area_share']:.0f} %",
                f"{report['flops']:,} ({report['gated_flops']:,})",
                str(report["structure"]["clock_gates"]),
                ", ".join(f"{hertz / 1e6:.0f}" for hertz in corners),
                str(path),
                "{proved:,} of {of:,}".format(**report["equivalence"]),
                report["commit"],
            ]
        )
    head = ["readout", "array", "cells", "um2 per taxel", "flops' share", "flops (gated)", "clock gates"]
    return markdown([*head, "MHz slow, typical, fast", "cells in the path", "points proved", "commit"], rows)


@table
def asic_power() -> str:
    """What the same netlists draw, and how many events they were held to the model in."""
    rows = []
    for report in netlists().values():
        if "power" not in report:
            continue
        wired, events = report["with_wires"], report["gate_level_events"]
        ratios = [s["agreement"] for power in (report["power"], wired["scenarios"]) for s in power.values()]
        rows.append(
            [
                named(report),
                f"{report['rows']} x {report['columns']}",
                cells_of(report),
                f"{1e9 * report['leakage_w_per_taxel']:.1f}",
                *(f"{1e9 * result['idle_w_per_taxel']:.1f}" for result in (report, wired)),
                *(energy(report, name) for name in ("", "lone_", "texture_")),
                *(energy(wired, name) for name in ("", "lone_")),
                f"{events['netlist']:,} of {events['rtl']:,}",
                f"{min(ratios):.3f} to {max(ratios):.3f}",
            ]
        )
    head = ["readout", "array", "cells", "leakage, nW a taxel", "idle", "with wires", "pJ an event, one in every clock"]
    head += ["alone", "on a texture", "with wires, one in every clock", "alone", "events, netlist of RTL"]
    return markdown([*head, "OpenSTA by tables"], rows)


@table
def asic_targets() -> str:
    """What 8 x 8 LCS in 130 nm should cost, and what it does."""
    digital, analog = netlists()["lcs-digital-8x8-ihp"], compared()["IHP 130 nm", "LCS analog", "none"]
    leaks = 2 * analog["leakage_w_per_taxel"]
    asked = [
        ("idle, digital", 60e-9, digital["idle_w_per_taxel"], 1e9, "nW per taxel"),
        ("idle, analog: twice its leakage", leaks, analog["idle_w_per_taxel"], 1e9, "nW per taxel"),
        *(
            (f"an event {how}, {name}", most, report[f"energy_per_{key}event_j"], 1e12, "pJ")
            for how, key, most in (("in every clock", "", 6e-12), ("alone", "lone_", 15e-12))
            for name, report in (("digital", digital), ("analog", analog))
        ),
        ("area, digital", 2217.0, digital["area_um2_per_taxel"], 1.0, "um2 per taxel"),
        ("area, analog", 1485.0, analog["area_um2"] / 64, 1.0, "um2 per taxel"),
    ]
    rows = [
        [what, f"{digits(most * unit, 4)} {name}", digits(found * unit, 4), "met" if found <= most else "**missed**"]
        for what, most, found, unit, name in asked
    ]
    return markdown(["8 x 8 LCS, 6 b, 130 nm, 1.28 MHz", "at most", "measured", ""], rows)


def compared() -> dict[tuple[str, str, str], dict[str, Any]]:
    """Return the power of the netlists that the power model compares, by cells, readout and wires.

    Those of ``make gatepower``, and the reports of ``make asic``, which come later and count.
    """
    found = [json.loads(path.read_text()) for path in sorted((ROOT / "docs/data/asic/gatepower").glob("*.json"))]
    for report in netlists().values():
        if (
            "power" in report
            and report["rows"] == 8
            and (report["frontend"], report["readout"]) in (*(("analog", "lcs"), ("analog", "nlcs"), ("", "frame")),)
        ):
            found += [report | {"scenarios": report["power"]}, report["with_wires"]]
    kept = {(cells_of(one), named(one), "estimated" if one["pitch_um"] else "none"): one for one in found}
    return dict(sorted(kept.items()))


@table
def gate_power() -> str:
    """What the netlists draw that the power model compares, without and with estimated wires."""
    rows = []
    for (cells, readout, wires), result in compared().items():
        ratios = [stretch["agreement"] for stretch in result["scenarios"].values()]
        rows.append(
            [
                *(readout, f"{result['rows']} x {result['columns']}", cells, wires),
                *(f"{1e9 * result[name]:.2f}" for name in ("idle_w_per_taxel", "leakage_w_per_taxel")),
                *(energy(result, name) for name in ("", "lone_", "texture_")),
                f"{min(ratios):.3f} to {max(ratios):.3f}",
            ]
        )
    head = [
        "readout",
        "array",
        "cells",
        "wires",
        "idle nW a taxel",
        "leakage",
        "pJ an event, one in every clock",
        "alone",
    ]
    return markdown([*head, "on a texture", "OpenSTA by tables"], rows)


@table
def power_measured() -> str:
    """What becomes of the comparison where the logic is that of netlists instead of the published energy."""
    names = ENCODERS | {"frame": "frames"}

    def parts(path: str) -> dict[str, Any]:
        return dict(read(path)["modes"]["consistent"][1])

    def micro(watts: float) -> str:
        return digits(1e6 * watts, 3)

    before, rows = parts("docs/data/fig6.json"), []
    for library, cells in measured_libraries():
        after = parts(f"docs/data/asic/{library}/fig6.json")
        for readout in ("lcs", "nlcs", "frame"):
            old, new = before[readout], after[readout]
            name = names[readout] if readout == "frame" else f"{names[readout]} analog"
            report = compared()[f"{'IHP' if library == 'ihp' else 'OSU'} {cells}", name, "none"]
            published = old["converter_parts"].get("logic", 0.0)
            rows.append(
                [
                    f"{names[readout]}, {cells}",
                    micro(published) if published else "none",
                    micro(new["converter_parts"]["logic"]),
                    micro(64 * report["leakage_w_per_taxel"]),
                    *(micro(found["total"]) for found in (old, new)),
                    *("" if readout == "frame" else by_frames(found, readout) for found in (before, after)),
                ]
            )
    head = ["6 b, 0.92 mV, uW", "logic at 435 fJ an event", "logic measured", "of which leakage", "total before", "now"]
    return markdown([*head, "by frames before", "now"], rows)


def measured_libraries() -> list[tuple[str, str]]:
    """Return the libraries in which the logic of all three readouts is measured."""
    both = (("ihp", "130 nm"), ("osu", "180 nm"))
    return [one for one in both if (ROOT / "docs/data/asic" / one[0] / "fig6.json").exists()]


def by_frames(parts: dict[str, Any], readout: str) -> str:
    """Return what a readout draws by what frames draw."""
    return digits(parts[readout]["total"] / parts["frame"]["total"], 3)


@table
def low_power() -> str:
    """What readouts of 8 x 8 taxels cost in 130 nm, idle and by the event; LCS before it was written for gates too."""
    before = {row["readout"]: row for row in read("docs/data/asic/low_power.json")["readouts"]}
    rows, watts = [], ("idle_w_per_taxel", "leakage_w_per_taxel")
    for report in netlists().values():
        if (cells_of(report), report["rows"]) != ("IHP 130 nm", 8):
            continue
        power = compared().get((cells_of(report), named(report), "none"), report)
        if old := before.get(named(report)):
            idle = "-" if old["idle_nw"] is None else f"{old['idle_nw']:,.1f}"
            leakage = "-" if old["leakage_nw"] is None else f"{old['leakage_nw']:.1f}"
            rows.append(
                [f"{named(report)}, before", f"{old['area_um2']:,}", f"{old['flops']:,} (0)", "0", idle, leakage]
            )
            rows[-1] += ["-", "-"]
        rows.append(
            [
                named(report),
                f"{report['area_um2_per_taxel']:,.0f}",
                f"{report['flops']:,} ({report['gated_flops']:,})",
                str(report["structure"]["clock_gates"]),
                *(f"{1e9 * power[name]:.1f}" if name in power else "-" for name in watts),
                *(energy(power, name) for name in ("", "lone_")),
            ]
        )
    head = ["8 x 8, 6 b, 130 nm", "um2 per taxel", "flops (gated)", "clock gates", "idle, nW a taxel", "leakage"]
    return markdown([*head, "pJ an event, one in every clock", "alone"], rows)


@table
def layout() -> str:
    """Layouts in 130 nm rules, and what was checked."""
    rows = []
    for path in sorted((ROOT / "docs/data/layout").glob("*.json")):
        said = json.loads(path.read_text())
        config, rules, compared = said["configuration"], said["rules"], said["comparison"]
        rows.append(
            [
                f"{ENCODERS[config['encoding']]}, {config['frontend']}, {config['rows']} x {config['columns']}",
                f"{said['cells']:,}",
                f"{said['width_um']:.0f} x {said['height_um']:.0f}",
                f"{said['width_um'] * said['height_um'] / config['rows'] / config['columns']:,.0f}",
                f"{100 * said['utilisation']:.0f} %",
                f"{len(rules['violations'])} in {rules['checked']} rules",
                f"{compared['transistors']:,} transistors equal" if compared else "not compared",
                f"{said['equivalence']['proved']} of {said['equivalence']['of']}",
                f"{sum(said['seconds'].values()):.0f}",
            ]
        )
    head = ["readout", "cells", "um x um", "um^2 a taxel", "cells' share", "violations", "netlist in the layout"]
    return markdown([*head, "points equal to the RTL", "processor s"], rows)


# -- speed -----------------------------------------------------------------------------------------


@table
def speed_encoders() -> str:
    """Encoders against a plain copy, for many signals and for one array."""
    names = {
        "copy": "copy",
        "lcs": "LCS",
        "lcs, counts per taxel only": "LCS, events per taxel only",
        "cw-lcs": "CW-LCS",
        "nlcs": "N-LCS (4,096 signals)",
        "lcs, numpy over time": "LCS, NumPy over the taxels, Python over time",
        "snntorch delta": "snnTorch `spikegen.delta` (1,024 signals)",
    }
    many, one = (
        {r["name"]: r for r in read(f"benchmarks/results/{name}.json")["results"]} for name in ("encoder", "encoder_64")
    )
    rows = []
    for name, text in names.items():
        times = many[name]["times_the_copy"]
        rows.append(
            [
                text,
                f"{many[name]['taxel_samples_per_second'] / 1e6:,.0f}",
                f"{digits(times['median'], 3)} ({digits(times['least'], 3)} to {digits(times['most'], 3)})",
                digits(one[name]["times_the_copy"]["median"], 3),
            ]
        )
    return markdown(["", "million taxel-samples/s", "times the copy", "64 taxels"], rows)


@table
def scale_arrays() -> str:
    """Generation, lint and simulation of square arrays."""
    rows = []
    made = {array["taxels"]: array["synthesis_s"] for array in read(SCALE)["results"]}
    for array in read("benchmarks/results/scale_arrays.json")["results"]:
        taxels = array["taxels"]
        runs = {(r["simulator"], r["row_by_row"]): r for r in array["simulations"]}
        whole, slow = runs["verilator", True], runs.get(("icarus", False))
        flat = runs.get(("verilator", False))
        rows.append(
            [
                f"{array['side']} x {array['side']}",
                f"{array['generate_s']:.1f} ({digits(1000 * array['generate_s'] / taxels, 2)})",
                f"{made[taxels]:.1f} ({digits(1000 * made[taxels] / taxels, 2)})" if taxels in made else "",
                f"{array['verilog_bytes'] / 1000:,.0f}",
                f"{array['lint_s']:.1f}",
                f"{whole['build_s']:.0f}",
                f"{whole['clocks_per_second']:,.0f} ({digits(whole['clocks_per_second'] * taxels / 1e6, 2)})",
                f"{flat['build_s']:.0f}; {flat['clocks_per_second']:,.0f}" if flat else "",
                f"{slow['clocks_per_second']:,.0f}" if slow else "",
            ]
        )
    head = [
        "taxels",
        "generation, s (ms a taxel)",
        "synthesis, s (ms a taxel)",
        "Verilog, kB",
        "lint, s",
        "build row by row, s",
    ]
    head += ["clocks/s (million taxel-clocks/s)", "flat: build, s; clocks/s", "Icarus, clocks/s"]
    return markdown(head, rows)


SCALE = "docs/data/asic/scale-lcs-digital-ihp.json"


@table
def scale_wires() -> str:
    """Area and highest clock of arrays, without wires and with them."""
    rows = []
    for array in read(SCALE)["results"]:
        without, wired = array["without_wires"], array["with_wires"]
        lines = wired["path_in_repeaters_s"] + wired["path_in_wires_s"]
        rows.append(
            [
                f"{array['rows']} x {array['columns']}",
                f"{array['cells_um2_per_taxel']:,.0f}",
                f"{wired['area_um2_per_taxel']:,.0f} ({digits(wired['repeaters'] / array['taxels'], 2)})",
                f"{digits(1000 * wired['lines_m'] / array['taxels'], 2)}",
                f"{without['fmax_hz'] / 1e6:.0f} ({without['logic_depth']})",
                f"{wired['fmax_hz'] / 1e6:.0f} ({wired['logic_depth']})",
                f"{100 * lines / wired['path_s']:.0f} %",
                f"{_block(wired['path'][0])} to {_block(wired['path'][-1])}",
            ]
        )
    head = ["taxels", "um2 a taxel, cells", "with repeaters (repeaters a taxel)", "lines, mm a taxel"]
    head += ["MHz without wires (cells in the path)", "MHz with wires", "of the path in lines and repeaters", "path"]
    return markdown(head, rows)


def _block(name: str) -> str:
    """Return what a path begins or ends at, in a word: the block of a flop, else the port."""
    return (
        name.split(".")[0].split("_")[0] if "." in name and "taxel" not in name else name.split("[")[0].split(".")[-1]
    )


@table
def scale_skins() -> str:
    """A skin of 65,536 taxels on one output."""
    rows = [
        [
            f"{skin['resolution']} b",
            f"{skin['clock_hz'] / 1e6:,.4g} MHz",
            f"{skin['clocks']:,}",
            f"{skin['events_of_tiles_alone']:,} ({skin['offered_per_clock']:.2f})",
            f"{skin['events']:,} ({skin['events_per_clock']:.2f})",
            f"{skin['fewest_of_a_tile']:,} to {skin['most_of_a_tile']:,}",
            f"{skin['model_s']:.1f}",
        ]
        for skin in read("benchmarks/results/scale_skins.json")["results"]
    ]
    head = [
        "LCS",
        "clock",
        "clocks",
        "tiles alone: events (a clock)",
        "merged: events (a clock)",
        "of a tile",
        "model, s",
    ]
    return markdown(head, rows)


@table
def speed_cosim() -> str:
    """Co-simulation and model against a bare Verilator loop."""
    rows = []
    for r in read("benchmarks/results/cosim.json")["results"]:
        median, least, most = (digits(r["of_bare_loop"][name], 3) for name in ("median", "least", "most"))
        rows.append([r["name"], f"{r['clocks_per_second']:,.0f}", f"{median} ({least} to {most})"])
    return markdown(["", "clocks/s", "of the bare loop"], rows)


@table
def speed_layer() -> str:
    """One training step of the recurrent layer: CPU time and memory of every candidate."""
    results = read("benchmarks/results/network.json")["results"]
    results.sort(key=lambda r: (r["rate"], r["steps"]))
    rows = []
    for name in results[0]["candidates"]:
        of_cases = [r["candidates"][name] for r in results]
        rows.append([name, *(_time_and_memory(case) for case in of_cases)])
    rows.append(["matrix products alone (torch)", *(f"{1e3 * r['limit_cpu_s']['median']:.1f}" for r in results)])
    kernel = [r["candidates"]["this project, kernel"]["cpu_s"]["median"] for r in results]
    fastest = [min(c["cpu_s"]["median"] for c in r["candidates"].values() if c["library"]) for r in results]
    rows.append(["fastest library or loop / kernel", *(f"{f / k:.1f}" for f, k in zip(fastest, kernel, strict=True))])
    limits = [r["limit_cpu_s"]["median"] for r in results]
    rows.append(["kernel / matrix products", *(f"{k / limit:.2f}" for k, limit in zip(kernel, limits, strict=True))])
    head = ["", *(f"{r['steps']} steps, {100 * r['input_density']:.0f} % of the inputs" for r in results)]
    return markdown(head, rows)


def _time_and_memory(candidate: dict[str, Any]) -> str:
    """Return ms, and MiB where they were measured."""
    milliseconds, memory = 1e3 * candidate["cpu_s"]["median"], candidate["peak_mib"]
    return f"{milliseconds:.1f}" if memory is None else f"{milliseconds:.1f}, {memory:.0f}"


@table
def leak() -> str:
    """The leak of N-LCS in integers against floating point, per cent of the event rate."""
    rows = []
    for r in read("benchmarks/results/leak.json")["results"]:
        low, high = r["exponential"]
        numbers = [f"{r['fractions'][fraction]:.2f}" for fraction in ("4", "6", "8", "10", "12")]
        limits = [f"{low:+.2f} to {high:+.2f}", f"{r['moving']:+.2f}"]
        rows.append([str(r["resolution"]), str(r["leak_shift"]), *numbers, *limits])
    return markdown(["N", "k", *(f"F = {f}" for f in (4, 6, 8, 10, 12)), "exponential", "moving"], rows)


# -- the classifier in hardware --------------------------------------------------------------------


@table
def touch() -> str:
    """What each step from touch to class takes, over a whole dataset in the RTL."""
    kept = read("docs/data/touch.json")
    chip = kept["chip"]
    seconds = kept["clocks"] / (chip["sample_rate_hz"] * chip["clocks_per_sample"])
    taxels, labelled = chip["rows"] * chip["columns"], kept["labelled"]
    samples = taxels * chip["sample_rate_hz"] * chip["sample_bits"] / 1e6
    rate, bits = kept["events"] / seconds, (taxels - 1).bit_length() + 1
    late_us = 1e6 * kept["latency_clocks"] * seconds / kept["clocks"]
    rows = [
        [
            "samples",
            f"{taxels} x {chip['sample_bits']} b at {chip['sample_rate_hz'] / 1e3:g} kHz",
            f"{samples:.1f} Mb/s",
        ],
        ["address events", f"{rate:,.0f} a second of {bits} b", f"{rate * bits / 1e3:.0f} kb/s"],
        [
            "network",
            f"{chip['classifier_hidden']} neurons, weights of {chip['classifier_rec_bits']} b",
            f"{kept['additions'] / seconds / 1e6:.1f} M additions/s",
        ],
        ["class", f"every {1e3 * chip['classifier_bin_s']:g} ms", f"{late_us:.0f} us after it at the latest"],
        ["right", f"{kept['right']} of {labelled} in the RTL", f"{kept['right_float']} of {labelled} before rounding"],
    ]
    sums = f"{kept['images']} images, {kept['clocks']:,} clocks, {kept['events']:,} events"
    said = f"`{kept['command']}`, commit {kept['commit']}, {kept['date']}: {sums}, {kept['mismatches']} mismatches."
    return markdown(["from touch to class", "", ""], rows) + f"\n{said}\n"


@table
def precision() -> str:
    """Accuracy of networks in whole numbers by bits of their weights."""
    kept = read("docs/data/classifier/precision.json")
    points = {(point["network"], point["variant"]): point for point in kept["points"]}
    variants = [v for v in dict.fromkeys(point["variant"] for point in kept["points"]) if v == "float" or v.isdigit()]
    rows = []
    for network in dict.fromkeys(name for name, _ in points):
        own = [points[network, variant] for variant in variants]
        memory = {point["variant"]: point["memory_bits"] / 8000 for point in own if "memory_bits" in point}
        cells = [f"{100 * point['accuracy']:.1f}" for point in own]
        sizes = f"{memory['8']:.0f}, {memory['4']:.0f}" if {"8", "4"} <= set(memory) else ""
        rows.append([network, str(own[0]["seeds"]), percent(own[0]).replace(" %", ""), *cells[1:], sizes])
    head = ["network", "seeds", "float", *(f"{variant} b" for variant in variants[1:]), "kB at 8, 4 b"]
    return markdown(head, rows) + f"\n`{kept['command']}`\n"


# -- verification ----------------------------------------------------------------------------------


@table
def fuzz() -> str:
    """The fuzz campaign: what was tried and how it ended."""
    kept = read("docs/data/verification/fuzz.json")
    rows = [
        [text, *(f"{kept[name][key]:,}" for key in ("cases", "refused", "right or different", "wrong"))]
        for name, text in (("files", "damaged files"), ("options", "values of options"))
    ]
    by = kept["files"]["by reader"], kept["files"]["by command"], kept["options"]["by command"]
    readers, commands = len(by[0]), len({*by[1], *by[2]})
    said = (
        f"`{kept['command']}`, commit {kept['commit']}, {kept['date']}: {readers} kinds of files, {commands} commands."
    )
    return markdown(["", "cases", "refused in a sentence", "done", "wrong"], rows) + f"\n{said}\n"


@table
def proofs() -> str:
    """What is proved of every block, and how many planted bugs each property has noticed."""
    report = read("docs/data/verification/formal.json")
    rows = [
        [
            row["block"].replace("_", " "),
            row["property"].replace("_", " "),
            row["meaning"],
            str(len(row["sizes"])),
            "any" if row["unbounded"] else "not proved",
            str(len(row["mutants_caught"]) or "not run"),
        ]
        for row in report["properties"]
    ]
    head = ["block", "property", "", "configurations", "length of a run", "planted bugs noticed"]
    return f"{markdown(head, rows)}\n`{report['command']}`, {report['commit']}, {report['date']}: {report['result']}.\n"


EVIDENCE = {
    "proved": ("formal", "properties of the RTL, runs of any length"),
    "covered": ("coverage", "RTL lines, branches, toggles; points of the specification"),
    "killed": ("mutants", "automatic mutants of the RTL that the tests notice"),
    "faults": ("faults", "upsets of every flop, and hostile surroundings"),
    "soaked": ("soak", "clocks of random configurations, RTL against model"),
    "hostile input": ("fuzz", "damaged files and absurd options"),
}
"""What is signed off, each with the name of its report in docs/data/verification, and what it is."""


def evidence(name: str) -> dict[str, Any] | None:
    """Return a report of the verification, None if there is none."""
    path = f"docs/data/verification/{name}.json"
    return dict(read(path)) if (ROOT / path).is_file() else None


@table
def signoff() -> str:
    """Every kind of evidence with its last result; where there is none the line says so."""
    rows = []
    for kind, (name, what) in EVIDENCE.items():
        kept = evidence(name)
        if kept is None:
            rows.append([kind, what, "**not yet**", "", "", ""])
            continue
        result = kept["result"] if name != "fuzz" else _fuzz_result(kept)
        rows.append([kind, what, result, f"`{kept['command']}`", kept["commit"], kept["date"]])
    return markdown(["", "what", "last result", "command", "commit", "date"], rows)


def _fuzz_result(kept: dict[str, Any]) -> str:
    cases, wrong = (sum(kept[kind][key] for kind in ("files", "options")) for key in ("cases", "wrong"))
    return f"fuzz: {cases:,} cases, {wrong} wrong"


@table
def stages() -> str:
    """How far every block is."""
    proved: dict[str, list[dict[str, Any]]] = {}
    for row in read("docs/data/verification/formal.json")["properties"]:
        proved.setdefault(row["block"], []).append(row)
    faults = evidence("faults") or {"blocks": []}
    rows = []
    for block, properties in proved.items():
        open_ones = sum(not row["unbounded"] or bool(row["problems"]) for row in properties)
        bugs = min(len(row["mutants_caught"]) for row in properties)
        upset = [one for one in faults["blocks"] if one["block"] == block]
        upsets, never = (sum(one[key] for one in upset) for key in ("upsets", "never recovers"))
        stage = "V1" if open_ones or bugs < 3 else "V3" if upsets and not never else "V2"
        rows.append(
            [
                block.replace("_", " "),
                stage,
                f"{len(properties) - open_ones} of {len(properties)}",
                str(bugs),
                f"{upsets:,}" if upsets else "not yet",
                f"{never:,}" if upsets else "",
            ]
        )
    head = ["block", "stage", "properties proved", "bugs seen by each, at least", "upsets tried", "never recovers"]
    return markdown(head, rows)


def _not_yet() -> str:
    return "Not run yet.\n"


@table
def faults() -> str:
    """What came of the upsets, by block and course."""
    kept = evidence("faults")
    if kept is None:
        return _not_yet()
    outcomes = ("nothing", "own events", "others moved", "others changed", "never recovers")
    rows = []
    for block in dict.fromkeys(line["block"] for line in kept["blocks"]):
        for course in ("calm", "loaded"):
            lines = [one for one in kept["blocks"] if (one["block"], one["trial"].split(", ")[-1]) == (block, course)]
            if not lines:
                continue
            total = sum(line["upsets"] for line in lines)
            shares = [f"{sum(line[name] for line in lines) / total:.1%}" for name in outcomes[:-1]]
            never = str(sum(line[outcomes[-1]] for line in lines))
            worst = f"{max(line['lost'] for line in lines)}, {max(line['added'] for line in lines)}"
            rows.append([block.replace("_", " "), course, f"{total:,}", *shares, worst, never])
    head = ["upset in", "course", "upsets", *outcomes[:-1], "most lost, added", outcomes[-1]]
    said = f"`{kept['command']}`, {kept['commit']}, {kept['date']}: {kept['result']}.\n"
    return f"{markdown(head, rows)}\n{said}"


@table
def hostile() -> str:
    """Hostile surroundings, what is stated of them, and in how many runs it was so."""
    kept = evidence("faults")
    if kept is None:
        return _not_yet()
    rows = []
    for name in dict.fromkeys(line["case"] for line in kept["cases"]):
        lines = [line for line in kept["cases"] if line["case"] == name]
        good, runs = (sum(line[key] for line in lines) for key in ("as stated", "runs"))
        rows.append([name, lines[0]["stated"], str(len(lines)), f"{good} of {runs}"])
    return markdown(["surroundings", "what happens", "readouts", "runs as stated"], rows)


@table
def parity() -> str:
    """How much of a taxel a single flop is, in netlists of real cells."""
    rows = []
    for name, text in (
        ("lcs-digital", "LCS, digital"),
        ("lcs-analog", "LCS, analog"),
        ("nlcs-digital", "N-LCS, digital"),
    ):
        netlist = read(f"docs/data/asic/{name}-8x8-ihp.json")
        taxels = netlist["configuration"]["rows"] * netlist["configuration"]["columns"]
        flops = netlist["flops"] / taxels
        rows.append([text, f"{flops:.1f}", f"{netlist['sequential_area_share'] / flops:.1%}"])
    return markdown(["8 x 8 taxels, IHP 130 nm", "flops per taxel", "one flop, of a taxel's area"], rows)


@table
def soak() -> str:
    """What was soaked."""
    kept = evidence("soak")
    if kept is None:
        return _not_yet()
    head = ["clocks", "events", "configurations", "runs", "taxels, at most", "hours", "mismatches"]
    row = [f"{kept[name]:,}" for name in ("clocks", "events", "configurations", "runs", "most_taxels")]
    row += [f"{kept['seconds'] / 3600:.1f}", str(kept["mismatches"])]
    by = "; ".join(", ".join(f"{name} {count}" for name, count in counts.items()) for counts in kept["by"].values())
    said = f"`{kept['command']}`, {kept['commit']}, {kept['date']}. Configurations: {by}.\n"
    return f"{markdown(head, [row])}\n{said}"


@table
def load() -> str:
    """Four arbiters under the same loads."""
    kept = read("benchmarks/results/load.json")
    rows = []
    for line in kept["results"]:
        name = f"{line['load']}, {line['asked']:.0%}" if line["arbiter"].endswith("(ours)") else ""
        numbers = [f"{line['throughput']:.3f}", f"{line['mean_wait']:.1f}", f"{line['wait_99']:.0f}"]
        numbers += [f"{line['worst_wait']:,}", f"{line['jain']:.3f}"]
        rows.append([name, line["arbiter"], *numbers, "{:,.1f} to {:,.1f}".format(*line["by_address"])])
    head = ["load", "arbiter", "events per clock", "mean wait", "99 %", "worst", "Jain", "mean wait by address"]
    said = f"`{kept['command']}`, {kept['commit']}, {kept['date']}.\n"
    return f"{markdown(head, rows)}\n{said}"


def filled(text: str) -> str:
    """Return a document with every table made anew."""
    return BLOCK.sub(lambda found: f"{found[1]}\n{TABLES[found[2]]()}\n{found[3]}", text)


if __name__ == "__main__":
    for page in PAGES:
        text = page.read_text()
        if (new := filled(text)) != text:
            page.write_text(new)
            print(page.relative_to(ROOT))
