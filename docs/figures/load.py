"""Draw docs/figures/load.png: waits at five arbiters, from benchmarks/results/load.json.

``python docs/figures/load.py`` from the top of the project.
"""

from __future__ import annotations

import json
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt

HERE = Path(__file__)
DATA = HERE.parents[2] / "benchmarks" / "results" / "load.json"


def main() -> None:
    """Draw the figure."""
    kept = json.loads(DATA.read_text())
    loads: dict[str, list[dict]] = {}
    for line in kept["results"]:
        loads.setdefault(f"{line['load']}, {line['asked']:.0%}", []).append(line)
    figure, (worst, bias) = plt.subplots(1, 2, figsize=(9.0, 4.0), sharey=True, layout="constrained")
    for number, arbiter in enumerate(line["arbiter"] for line in next(iter(loads.values()))):
        lines = [next(line for line in found if line["arbiter"] == arbiter) for found in loads.values()]
        heights = [place + 0.15 * (number - 2) for place in range(len(loads))]
        colour = f"C{number}"
        worst.plot([line["worst_wait"] for line in lines], heights, "o", color=colour, markersize=4)
        low, high = zip(*(line["by_address"] for line in lines), strict=True)
        bias.hlines(heights, low, high, color=colour, linewidth=2.5, label=arbiter)
    worst.axvline(kept["bound"], color="0.6", linewidth=1)
    worst.annotate(
        f"bound {kept['bound']}", (kept["bound"], -0.5), xytext=(4, 0), textcoords="offset points", color="0.4"
    )
    worst.set(xlabel="worst wait / clocks", ylim=(len(loads) - 0.4, -1.0))
    worst.set_yticks(range(len(loads)), list(loads))
    bias.set(xlabel="mean wait, from the best to the worst address / clocks")
    bias.legend(frameon=False, fontsize="small", loc="upper right")
    for axis in (worst, bias):
        axis.set_xscale("log")
        axis.grid(axis="x", color="0.92")
        axis.set_axisbelow(True)
    figure.savefig(HERE.with_suffix(".png"), dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main()
