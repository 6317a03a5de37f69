"""One HTML file with the figures of the whole project (docs/guide/report.md).

The page is ``page.html`` with a style sheet, two scripts and the data as JSON put into it. The scripts are written
by hand, since a chart library in every page would be ten times as large as all the rest. They compute no power: all
numbers come from here, on a grid.
"""

from __future__ import annotations

import html
import json
import string
from collections.abc import Iterable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from model.figures.style import OFF_COLOUR, ON_COLOUR, PALETTE, PART_COLOURS, READOUT_COLOURS, TAU_COLOURS
from model.figures.units import plain, with_unit

Data = dict[str, Any]

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks" / "results"
"""Of a checkout; an installed package has none, and the page says so."""
ACCURACY = Path(__file__).with_name("fig9.json")
"""The data of Fig. 9 that come with the project, from ``python -m snn fig9``."""
SIM = Path("out/sim")
REPLAY = Path("out/replay")

SOURCES = ("page.html", "page.css", "drawing.js", "charts.js", "raster.js")
"""What the page is made of, beside this module."""

SYNTHESIS_UNITS = {"leakage_w": "W", "clock_power_w_per_hz": "W/Hz", "energy_per_event_j": "J"}

SECTIONS = ("raster", "replay", "fig9", "benchmarks", "synthesis")
"""Sections of which something may be missing."""


def runs_in(folder: Path) -> tuple[Path, Path]:
    """Return the folders of the runs of ``make sim`` and ``make replay`` that were given this folder as OUT.

    They lie in it, or in ``sim`` and ``replay`` in it as in ``out``.
    """
    inner = (folder / "sim", folder / "replay")
    return tuple(place if place.is_dir() else folder for place in inner)  # type: ignore[return-value]


# -- the page ----------------------------------------------------------------------------------------


def page(data: Data) -> str:
    """Return the page of some data (``model.report.data``); the same data give the same page."""
    from model.power.equations import READOUT_NAMES

    folder = resources.files("model.report")
    template, style, *scripts = ((folder / name).read_text("utf-8") for name in SOURCES)
    parts = {f"{section}_missing": _sentences(data["missing"].get(section, [])) for section in SECTIONS}
    tables = {
        "raster_table": _raster_table(data["raster"]),
        "replay_table": _replay_table(data["replay"]),
        "fig6_table": _fig6_table(data["fig6"]),
        "fig7_table": _fig7_table(data["fig7"]),
        "sensitivity_table": _sensitivity_table(data["sensitivity"]),
        "fig9_table": _fig9_table(data["fig9"]),
        "benchmarks_table": _benchmarks_table(data["benchmarks"]),
        "synthesis_table": _synthesis_table(data["synthesis"]),
    }
    fig6 = data["fig6"]
    gates = ", ".join(READOUT_NAMES[found["readout"]] for found in data["synthesis"])
    return string.Template(template).substitute(
        **parts,
        **tables,
        style=f":root {{ {palette()} }}\n{style}",
        script="".join(scripts),
        version=html.escape(data["version"]),
        array=f"{fig6['rows']} x {fig6['columns']}",
        rates=html.escape(fig6.get("event_rates", "")),
        logic=f"synthesis ({gates})" if gates else "a published energy of 435 fJ an event",
        resolution=fig6["resolution"],
        tau=f"{fig6['tau_s']:g}",
        data=embedded(data),
    )


def palette() -> str:
    """Return the colours of the figures as custom properties of the style sheet; black ones follow the text there."""
    colours = READOUT_COLOURS | PART_COLOURS | {f"tau{k}": colour for k, colour in enumerate(TAU_COLOURS)}
    colours |= {"on": ON_COLOUR, "off": OFF_COLOUR}
    return " ".join(f"--{name}: {colour};" for name, colour in colours.items() if colour != PALETTE["black"])


def embedded(data: Any) -> str:
    """Return data as JSON that can stand in a script element: without ``<``."""
    return json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _sentences(sentences: Iterable[str]) -> str:
    return "\n".join(f'<p class="missing">{html.escape(sentence)}</p>' for sentence in sentences)


def _table(caption: str, headings: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table whose first column names the rows; nothing without rows."""

    def cell(value: Any) -> str:
        text = "-" if value is None else plain(value) if isinstance(value, float) else str(value)
        return f"<td>{html.escape(text)}</td>"

    lines = [
        f'<tr><th scope="row">{html.escape(str(row[0]))}</th>' + "".join(cell(value) for value in row[1:]) + "</tr>"
        for row in rows
    ]
    if not lines:
        return ""
    head = "".join(f'<th scope="col">{html.escape(heading)}</th>' for heading in headings)
    return (
        f'<div class="scroll"><table><caption>{html.escape(caption)}</caption><thead><tr>{head}</tr></thead>\n'
        f"<tbody>{chr(10).join(lines)}</tbody></table></div>"
    )


def _raster_table(runs: list[Data]) -> str:
    rows = [
        (
            run["name"],
            f"{run['encoding']} {run['resolution']} b",
            f"{run['rows']} x {run['columns']}",
            run["texture"],
            with_unit(run["duration_clocks"] / run["clock_hz"], "s"),
            *(f"{recording['events']:,}" if recording else None for recording in _both(run)),
            run["verdict"],
        )
        for run in runs
    ]
    headings = ("run", "encoding", "array", "texture", "length", "events, RTL", "events, model", "outcome")
    return _table("Recordings, and what their comparison says", headings, rows)


def _both(run: Data) -> list[Data | None]:
    """Return the recordings of RTL and model of a run; None where there is none."""
    by_label = {recording["label"]: recording for recording in run["recordings"]}
    rtl = by_label.get("RTL")
    model = by_label["model"]
    return [rtl, rtl if "same_as" in model else model]


def _replay_table(replays: list[Data]) -> str:
    rows = [
        (
            f"{r['dataset']}, {r['preset']} scan",
            f"{r['encoding']} {r['resolution']} b, {r['rows']} x {r['columns']}",
            *(f"{r[key]:,}" for key in ("images", "clocks", "events", "mismatches")),
        )
        for r in replays
    ]
    headings = ("dataset", "readout", "images", "clocks", "events", "mismatches")
    return _table("Whole datasets through the RTL (make replay)", headings, rows)


def _fig6_table(fig6: Data) -> str:
    from model.power.equations import READOUT_NAMES, READOUTS

    rows = [
        (
            f"{mode}, {noise * 1e3:.3g} mV, {READOUT_NAMES[r]}",
            *(with_unit(entry[r][p], "W") for p in ("afe", "converter", "io", "total")),
        )
        for mode, entries in fig6["modes"].items()
        for noise, entry in zip(fig6["noise_v_rms"], entries, strict=True)
        for r in READOUTS
    ]
    return _table("Fig. 6", ("mode, noise, readout", "AFE", "converter", "I/O", "total"), rows)


def _fig7_table(fig7: Data) -> str:
    rows: list[Sequence[Any]] = []
    for mode, entry in fig7["modes"].items():
        for what, values in (("crossover", entry["crossover"]), ("spiking / frame at 1 mV", entry["ratio"])):
            lines = {f"N-LCS {float(tau):g} s": line for tau, line in values["nlcs"].items()} | {"LCS": values["lcs"]}
            for name, line in lines.items():
                cells = [with_unit(v, "V") if what == "crossover" and v is not None else v for v in line]
                rows.append((f"{mode}, {what}, {name}", *cells))
    headings = ("mode, quantity, readout", *(f"N = {n}" for n in fig7["resolution"]))
    return _table("Fig. 7; a dash where there is no crossover", headings, rows)


def _sensitivity_table(study: Data) -> str:
    from model.power.equations import READOUT_NAMES, SPIKING
    from model.power.study import crossover_text

    rows = [
        (row["case"], *(x for s in SPIKING for x in (*row["ratio"][s], crossover_text(row["crossover"][s]))))
        for row in study["rows"]
    ]
    headings = ["corrections"]
    for s in SPIKING:
        headings += [f"{READOUT_NAMES[s]} {noise * 1e3:.3g} mV" for noise in study["noise_v_rms"]] + ["spikes win"]
    return _table("Spiking / frame power; below 1 spikes cost less", headings, rows)


def _fig9_table(fig9: Data | None) -> str:
    rows = [
        (
            p["label"],
            with_unit(p["data_rate_bps"], "bit/s"),
            f"{100 * p['accuracy']:.1f} %",
            "\N{NO-BREAK SPACE}to\N{NO-BREAK SPACE}".join(f"{100 * end:.1f}" for end in p.get("interval", ())),
        )
        for p in (fig9["points"] if fig9 else [])
    ]
    return _table("Fig. 9", ("readout", "data rate", "accuracy", "interval (%)"), rows)


def _benchmarks_table(charts: list[Data]) -> str:
    rows = [
        (f"{chart['name']}: {bar['name']}", *(bar.get(end) for end in ("median", "least", "most")))
        for chart in charts
        for bar in chart["bars"]
    ]
    return _table("Ratios within one run", ("benchmark", "median", "least", "most"), rows)


def _synthesis_table(reports: list[Data]) -> str:
    from model.power.equations import READOUT_NAMES

    rows = [
        (
            READOUT_NAMES[r["readout"]],
            f"{r['rows']} x {r['columns']}",
            r["process"] or None,
            *(with_unit(r[key], unit) for key, unit in (("supply_v", "V"), ("clock_hz", "Hz"))),
            f"{plain(r['area_um2'])} um^2",
            *(with_unit(r[key], unit) for key, unit in SYNTHESIS_UNITS.items()),
        )
        for r in reports
    ]
    headings = ("readout", "array", "process", "supply", "clock", "area", "leakage", "clock power", "event or sample")
    return _table("Digital part by synthesis", headings, rows)
