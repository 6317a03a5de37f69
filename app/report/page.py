"""Write the HTML report (docs/guide/report.md).

Pictures are those of the commands, embedded as data; the page has no script and loads nothing.
"""

from __future__ import annotations

import base64
import html
import json
import string
import tempfile
from collections.abc import Callable, Iterable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from eskin.app.report.data import Run
from eskin.base.figures.style import GREY, dress, new_figure, save_figure
from eskin.base.units import plain, with_unit
from eskin.skin.figures.readouts import LOOKS, Look

Data = dict[str, Any]

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks" / "results"
"""Of a checkout; an installed package has none, and the page says so."""
ACCURACY = Path(__file__).with_name("fig9.json")
"""The data of Fig. 9 that come with the project, from ``eskin fig9``."""
SIM = Path("out/sim")
REPLAY = Path("out/replay")

SYNTHESIS_UNITS = {"leakage_w": "W", "clock_power_w_per_hz": "W/Hz", "energy_per_event_j": "J"}


def runs_in(folder: Path) -> tuple[Path, Path]:
    """Return the folders with runs of ``make sim`` and ``make replay`` below a folder.

    They are in this folder, or in its folders ``sim`` and ``replay``, as in ``out``.
    """
    inner = (folder / "sim", folder / "replay")
    return tuple(place if place.is_dir() else folder for place in inner)  # type: ignore[return-value]


def page(data: Data, runs: Sequence[Run]) -> str:
    """Return the HTML page for the report data."""
    from eskin.power.figures.plots import plot_explore, plot_fig6, plot_fig7, plot_sensitivity

    fig6, sensor = data["fig6"], data["explore"]["sensor"]
    point = f"{fig6['resolution']} bit, tau {fig6['tau_s']:g} s"
    modes = (
        f"{fig6['rows']} x {fig6['columns']} taxels, {point}. Mode paper is the published model; mode consistent makes "
        f"all corrections (docs/results/power.md), with event rates measured on textures "
        f"({fig6.get('event_rates', '')})."
    )
    explore = (
        f"<p>At {with_unit(sensor['noise_v_rms'], 'V')} of AFE noise; eskin explore computes it for your sensor.</p>"
    )
    sections = [
        ("Events of RTL and model", [*map(run_section, runs), _runs_table(data["raster"])], "raster"),
        ("Whole datasets", [_replay_table(data["replay"])], "replay"),
        ("Cheapest readout", [explore, _picture(plot_explore, data["explore"], alt="Power by resolution")], ""),
        (
            "Fig. 6: power at three noise targets",
            [f"<p>{html.escape(modes)}</p>", _picture(plot_fig6, fig6, alt="Power at three noise targets")],
            "",
        ),
        (
            "Fig. 7: noise at which spikes cost what frames cost",
            [_picture(plot_fig7, data["fig7"], alt="Crossover noise by resolution")],
            "",
        ),
        (
            "What each correction does",
            [_picture(plot_sensitivity, data["sensitivity"], alt="Spiking / frame power by correction")],
            "",
        ),
        ("Fig. 9: accuracy against data rate", [_accuracy(data["fig9"])], "fig9"),
        ("Benchmarks", [_benchmarks_table(data["benchmarks"])], "benchmarks"),
        ("Synthesis", [_synthesis_table(data["synthesis"])], "synthesis"),
    ]
    body, links = [], []
    for number, (heading, parts, key) in enumerate(sections):
        lacks = "".join(f'<p class="missing">{html.escape(text)}</p>\n' for text in data["missing"].get(key, ()))
        body.append(f'<section id="s{number}">\n<h2>{heading}</h2>\n{lacks}{"".join(parts)}</section>')
        links.append(f'<a href="#s{number}">{heading}</a>')
    template = (resources.files("eskin.app.report") / "page.html").read_text("utf-8")
    return string.Template(template).substitute(
        version=html.escape(data["version"]),
        links=" ".join(links),
        sections="\n".join(body),
        data=embedded(data),
    )


def embedded(data: Any) -> str:
    """Return data as JSON that is safe in a script element."""
    return json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


# -- pictures ----------------------------------------------------------------------------------------


def _picture(plot: Callable[..., None], *args: Any, alt: str, kind: str = "svg", **options: Any) -> str:
    """Return the picture of a plot function as HTML with embedded data."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"picture.{kind}"
        plot(*args, path=path, **options)
        text = base64.b64encode(path.read_bytes()).decode()
    return f'<img alt="{html.escape(alt)}" src="data:image/{"svg+xml" if kind == "svg" else kind};base64,{text}">\n'


def run_section(run: Run) -> str:
    """Return heading, verdict and raster of a run as HTML."""
    from eskin.skin.figures.raster import plot_comparison, plot_signals

    config, facts = run.model.config, run.to_dict()
    said: Data = {"alt": f"Raster of {run.name}", "kind": "png", "duration_clocks": run.model.duration_clocks}
    if run.rtl is None:
        picture = _picture(plot_signals, run.model.events, run.samples, config, **said)
    else:
        picture = _picture(plot_comparison, (run.rtl.events, run.model.events), config, **said)
    title = html.escape(f"{run.name}: {facts['texture']}")
    return f'<h3>{title}</h3>\n<p class="verdict">{html.escape(run.verdict)}</p>\n{picture}'


def _plot_accuracy(data: Data, path: Path) -> None:
    """Plot accuracy against data rate, one panel per preset; published points are hollow."""
    presets = list(dict.fromkeys(point.get("preset", "") for point in data["points"]))
    figure = new_figure(1.6 + 4.6 * len(presets), 4.6, "")
    panels = figure.subplots(1, len(presets), sharex=True, sharey=True, squeeze=False)[0]
    for panel, preset in zip(panels, presets, strict=True):
        dress(panel)
        panel.set_title(f"{preset} scan" if preset else "", fontsize=9, parse_math=False)
        series: dict[tuple[str, str], list[Data]] = {}
        for point in data["points"]:
            if point.get("preset", "") == preset:
                series.setdefault((point["readout"], point.get("title", "")), []).append(point)
        for number, ((readout, title), points) in enumerate(series.items()):
            kind, published = readout.split(",")[0], "published" in (title, readout.rpartition(", ")[2])
            look = LOOKS.get(kind, Look(kind, GREY, "o"))  # a user's own readout
            points.sort(key=lambda point: point["data_rate_bps"])
            values = [100 * point["accuracy"] for point in points]
            ends = [point.get("interval", (point["accuracy"],) * 2) for point in points]
            bars = [[abs(v - 100 * end[side]) for v, end in zip(values, ends, strict=True)] for side in (0, 1)]
            panel.errorbar(
                [point["data_rate_bps"] for point in points], values, yerr=bars, lw=1, ms=6, capsize=2,
                color=look.colour, marker=look.marker,
                ls="-" if title and len(points) > 1 else "", fillstyle="none" if published else "full",
                label=", ".join(filter(None, (kind, title))) or f"series {number}",
            )  # fmt: skip
            for point, value in zip(points, values, strict=True):
                panel.annotate(point.get("detail", ""), (point["data_rate_bps"], value), xytext=(4, 4), fontsize=6.5,
                               textcoords="offset points", color=GREY, parse_math=False)  # fmt: skip
        panel.set_xscale("log")
        panel.set_xlabel("data rate (bit/s)", fontsize=8.5)
        for text in panel.legend(fontsize=7, frameon=False, loc="best").get_texts():
            text.set_parse_math(False)
    panels[0].set_ylabel("accuracy (%)", fontsize=8.5)
    save_figure(figure, path)


# -- tables ------------------------------------------------------------------------------------------


def _table(caption: str, headings: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return an HTML table whose first column names the rows; empty without rows."""

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
        f'<div class="scroll"><table><caption>{html.escape(caption)}</caption>'
        f"<thead><tr>{head}</tr></thead>\n<tbody>{chr(10).join(lines)}</tbody></table></div>\n"
    )


def _runs_table(runs: list[Data]) -> str:
    headings = ("run", "readout", "texture", "length", "events, RTL", "events, model", "outcome")
    keys = ("name", "readout", "texture", "duration", "events_rtl", "events_model", "verdict")
    rows = [[f"{run[key]:,}" if isinstance(run[key], int) else run[key] for key in keys] for run in runs]
    return _table("Recordings and the result of their comparison", headings, rows)


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


def _accuracy(fig9: Data | None) -> str:
    """Return picture and table of Fig. 9 as HTML."""
    if fig9 is None:
        return ""
    rows = [
        (
            p["label"],
            with_unit(p["data_rate_bps"], "bit/s"),
            f"{100 * p['accuracy']:.1f} %",
            "\N{NO-BREAK SPACE}to\N{NO-BREAK SPACE}".join(f"{100 * end:.1f}" for end in p.get("interval", ())),
        )
        for p in fig9["points"]
    ]
    table = _table("Fig. 9", ("readout", "data rate", "accuracy", "interval (%)"), rows)
    return _picture(_plot_accuracy, fig9, alt="Accuracy by data rate") + table


def _benchmarks_table(ratios: list[Data]) -> str:
    rows = [(r["name"], r["ratio"], *(r.get(end) for end in ("median", "least", "most"))) for r in ratios]
    return _table("Ratios within one run on one machine", ("benchmark", "ratio", "median", "least", "most"), rows)


def _synthesis_table(reports: list[Data]) -> str:
    from eskin.power.readouts import READOUT_NAMES

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
