"""Draw docs/figures/load.png: waiting times at five arbiters against link load.

``python docs/figures/load.py`` from the top of the project.
"""

import json
from pathlib import Path

from eskin.base.figures.style import GREY, PALETTE, dress, legend_below, new_figure, save_figure

HERE = Path(__file__)
COLOURS = [PALETTE[name] for name in ("blue", "orange", "grey", "black", "sky")]
DATA = HERE.parents[2] / "benchmarks" / "results" / "load.json"


def main() -> None:
    """Draw the figure."""
    kept = json.loads(DATA.read_text())
    loads: dict[str, list[dict]] = {}
    for line in kept["results"]:
        loads.setdefault(f"{line['load']}, {line['asked']:.0%}", []).append(line)
    figure = new_figure(9.0, 4.8, "Waits at arbiters, by load of the link")
    worst, bias = figure.subplots(1, 2, sharey=True)
    dress(worst, "worst wait", "wait (clocks)")
    dress(bias, "mean wait, from the best to the worst address", "wait (clocks)")
    for number, arbiter in enumerate(line["arbiter"] for line in next(iter(loads.values()))):
        lines = [next(line for line in found if line["arbiter"] == arbiter) for found in loads.values()]
        heights = [place + 0.15 * (number - 2) for place in range(len(loads))]
        colour = COLOURS[number]
        worst.plot([line["worst_wait"] for line in lines], heights, "osD^v"[number], color=colour, markersize=4)
        low, high = zip(*(line["by_address"] for line in lines), strict=True)
        bias.hlines(heights, low, high, color=colour, linewidth=2.5, label=arbiter)
    worst.axvline(kept["bound"], color=GREY, linewidth=1)
    place = (kept["bound"], -0.5)
    worst.annotate(f"bound {kept['bound']}", place, (4, 0), textcoords="offset points", color=GREY, fontsize=8)
    worst.set_ylim(len(loads) - 0.4, -1.0)
    worst.set_yticks(range(len(loads)), [name.replace("%", " %") for name in loads])
    for axis in (worst, bias):
        axis.set_xscale("log")
        axis.xaxis.set_major_formatter(lambda clocks, _: f"{clocks:,g}")
    legend_below(figure, bias.get_legend_handles_labels(), 5)
    save_figure(figure, HERE.with_suffix(".png"))


if __name__ == "__main__":
    main()
