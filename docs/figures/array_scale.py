"""Draw docs/figures/array_scale.png: area and highest clock frequency against array size.

``python docs/figures/array_scale.py`` from the top of the project.
"""

import json
from pathlib import Path
from typing import Any

from eskin.base.figures.style import PALETTE, dress, legend_below, new_figure, save_figure

HERE = Path(__file__)
ARRAYS, TILES = (HERE.parents[1] / "data" / "asic" / f"scale-{name}lcs-digital-ihp.json" for name in ("", "tiles-"))


def main() -> None:
    """Draw the figure."""
    arrays = json.loads(ARRAYS.read_text())["results"]
    found = {(r["tile_rows"], r["relays"]): r for r in json.loads(TILES.read_text())["results"]}
    skins = [found[4, 1], found[8, 2]]
    taxels = [array["taxels"] for array in arrays]
    figure = new_figure(9.0, 4.2, "LCS arrays of standard cells as they grow")
    clock, area = figure.subplots(1, 2)
    dress(clock, "highest clock", "taxels", "highest clock (MHz)")
    dress(area, "area", "taxels", "area (um2 per taxel)")
    alone: dict[str, Any] = {"color": PALETTE["sky"], "marker": "o", "ls": "--", "label": "cells alone"}
    wired: dict[str, Any] = {
        "color": PALETTE["blue"],
        "marker": "s",
        "label": "with wires and the repeaters of the lines",
    }
    for name, style in (("without_wires", alone), ("with_wires", wired)):
        clock.plot(taxels, [array[name]["fmax_hz"] / 1e6 for array in arrays], **style)
    area.plot(taxels, [array["cells_um2_per_taxel"] for array in arrays], **alone)
    area.plot(taxels, [array["with_wires"]["area_um2_per_taxel"] for array in arrays], **wired)
    for axis, name, unit in ((clock, "fmax_hz", 1e6), (area, "area_um2_per_taxel", 1.0)):
        for skin, mark, colour in zip(skins, ("o", "*"), ("grey", "black"), strict=True):
            label = f"tiles of {skin['rows'] // skin['tile_rows']} x {skin['columns'] // skin['tile_columns']}"
            axis.plot([skin["taxels"]], [skin["with_wires"][name] / unit], mark, ms=9, color=PALETTE[colour],
                      ls="", label=label)  # fmt: skip
        axis.set_xscale("log")
        axis.set_ylim(0, 1.05 * axis.get_ylim()[1])
        axis.set_xticks(taxels, [str(number) if number != 192 else "" for number in taxels], minor=False)
        axis.minorticks_off()
    legend_below(figure, clock.get_legend_handles_labels(), 4)
    save_figure(figure, HERE.with_suffix(".png"))


if __name__ == "__main__":
    main()
