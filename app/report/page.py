"""Write the HTML report (docs/guide/report.md).

Pictures are those of the commands, embedded as data; the page has no script and loads nothing.
"""

import json
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from markupsafe import Markup

from eskin.app.report.data import Run
from eskin.base.figures.style import GREY, dress, new_figure, save_figure
from eskin.base.pages import embedded, templates
from eskin.base.rows import Template
from eskin.base.units import with_unit
from eskin.skin.figures.readouts import LOOKS, Look

Data = dict[str, Any]

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks" / "results"
"""Benchmark results of a checkout; an installed package has none, and the page reports this."""
ACCURACY = Path(__file__).with_name("fig9.json")
"""The data of Fig. 9 that come with the project, from ``eskin fig9``."""
SIM = Path("out/sim")
REPLAY = Path("out/replay")

PAGES = templates(Path(__file__).parent)


def runs_in(folder: Path) -> tuple[Path, Path]:
    """Return the folders with runs of ``make sim`` and ``make replay`` below a folder.

    They are in this folder, or in its folders ``sim`` and ``replay``, as in ``out``.
    """
    inner = (folder / "sim", folder / "replay")
    return tuple(place if place.is_dir() else folder for place in inner)  # type: ignore[return-value]


def page(data: Data, runs: Sequence[Run]) -> str:
    """Return the HTML page for the report data."""
    from eskin.power.figures.plots import plot_explore, plot_fig6, plot_fig7, plot_sensitivity
    from eskin.power.readouts import READOUT_NAMES

    def drawn(plot: Callable[[Data, Path], None], name: str, words: str) -> Markup:
        return embedded(partial(plot, data[name]), words, "svg")

    points = data["fig9"]["points"] if data["fig9"] else []
    space = "\N{NO-BREAK SPACE}"
    rows = data | {
        "fig9": [
            p | {"ends": f"{space}to{space}".join(f"{100 * e:.1f}" for e in p.get("interval", ()))} for p in points
        ],
        "synthesis": [
            r | {"title": READOUT_NAMES[r["readout"]], "process": r["process"] or None} for r in data["synthesis"]
        ],
    }
    return PAGES.get_template("page.html").render(
        version=data["version"],
        runs=[run_section(run) for run in runs],
        rows=rows,
        cells_of=Template().cells,
        missing=data["missing"],
        fig6=data["fig6"],
        noise=with_unit(data["explore"]["sensor"]["noise_v_rms"], "V"),
        pictures={
            "explore": drawn(plot_explore, "explore", "Power by resolution"),
            "fig6": drawn(plot_fig6, "fig6", "Power at three noise targets"),
            "fig7": drawn(plot_fig7, "fig7", "Crossover noise by resolution"),
            "sensitivity": drawn(plot_sensitivity, "sensitivity", "Spiking / frame power by correction"),
            "fig9": drawn(_plot_accuracy, "fig9", "Accuracy by data rate") if points else "",
        },
        data=Markup(json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")),
    )


def run_section(run: Run) -> str:
    """Return heading, verdict and raster of a run as HTML."""
    from eskin.skin.figures.raster import plot_comparison, plot_signals

    config, clocks = run.model.config, run.model.duration_clocks

    def raster(path: Path) -> None:
        if run.rtl is None:
            plot_signals(run.model.events, run.samples, config, path, duration_clocks=clocks)
        else:
            plot_comparison((run.rtl.events, run.model.events), config, path, duration_clocks=clocks)

    text = Markup('<h3>{}: {}</h3>\n<p class="verdict">{}</p>\n')
    title = text.format(run.name, run.to_dict()["texture"], run.verdict)
    return title + embedded(raster, f"Raster of {run.name}")


def _plot_accuracy(data: Data, path: Path) -> None:
    """Plot accuracy against data rate, one panel per preset; published points are hollow."""
    presets = list(dict.fromkeys(point.get("preset", "") for point in data["points"]))
    figure = new_figure(1.6 + 4.6 * len(presets), 4.6, "")
    panels = figure.subplots(1, len(presets), sharex=True, sharey=True, squeeze=False)[0]
    for panel, preset in zip(panels, presets, strict=True):
        dress(panel, "", "data rate (bit/s)")
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
        for text in panel.legend(fontsize=7, frameon=False, loc="best").get_texts():
            text.set_parse_math(False)
    panels[0].set_ylabel("accuracy (%)", fontsize=8.5)
    save_figure(figure, path)
