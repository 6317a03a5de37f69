"""Draw docs/figures/array_scale.png: area and highest clock as the array grows, from docs/data/asic.

``python docs/figures/array_scale.py`` from the top of the project.
"""

from __future__ import annotations

import json
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt

HERE = Path(__file__)
ARRAYS, TILES = (HERE.parents[1] / "data" / "asic" / f"scale-{name}lcs-digital-ihp.json" for name in ("", "tiles-"))


def main() -> None:
    """Draw the figure."""
    arrays = json.loads(ARRAYS.read_text())["results"]
    found = {(r["tile_rows"], r["relays"]): r for r in json.loads(TILES.read_text())["results"]}
    skins = [found[4, 1], found[8, 2]]
    taxels = [array["taxels"] for array in arrays]
    figure, (clock, area) = plt.subplots(1, 2, figsize=(8.0, 3.4), layout="constrained")
    for name, label, mark in (("without_wires", "without wires", "o--"), ("with_wires", "with wires", "s-")):
        clock.plot(taxels, [array[name]["fmax_hz"] / 1e6 for array in arrays], mark, label=label)
    clock.set(ylabel="highest clock / MHz", ylim=(0, None))
    area.plot(taxels, [array["cells_um2_per_taxel"] for array in arrays], "o--", label="cells")
    with_lines = [array["with_wires"]["area_um2_per_taxel"] for array in arrays]
    area.plot(taxels, with_lines, "s-", label="with the repeaters of the lines")
    area.set(ylabel="area / (um2 per taxel)", ylim=(0, None))
    for axis, name, unit in ((clock, "fmax_hz", 1e6), (area, "area_um2_per_taxel", 1.0)):
        for skin, mark in zip(skins, ("*", "P"), strict=True):
            label = f"tiles of {skin['rows'] // skin['tile_rows']} x {skin['columns'] // skin['tile_columns']}"
            axis.plot([skin["taxels"]], [skin["with_wires"][name] / unit], mark, ms=9, label=label)
        axis.set(xscale="log", xlabel="taxels")
        axis.set_xticks(taxels, [str(number) for number in taxels], minor=False)
        axis.minorticks_off()
        axis.legend(frameon=False, fontsize="small")
    figure.savefig(HERE.with_suffix(".png"), dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main()
