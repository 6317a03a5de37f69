"""What the page of scale claims: arrays, their lines, and tiles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from docs.tables.claims import claim
from docs.tables.speed import SCALE, TILES
from docs.tables.written import read
from model.power.rates import stored_table

PAGE = "docs/results/scale.md"


def array(side: int) -> dict[str, Any]:
    """Return a square array."""
    (found,) = (one for one in read(SCALE)["results"] if (one["rows"], one["columns"]) == (side, side))
    return dict(found)


def tiles(side: int, relays: int) -> dict[str, Any]:
    """Return 64 x 64 taxels as tiles of some side, with relay stations."""
    keys = {"tile_rows": 64 // side, "tile_columns": 64 // side, "relays": relays}
    (found,) = (one for one in read(TILES)["results"] if keys.items() <= one.items())
    return dict(found)


def area(one: dict[str, Any]) -> float:
    """Return the area of a taxel with its repeaters in um^2."""
    return float(one["with_wires"]["area_um2_per_taxel"])


def mega(one: dict[str, Any], name: str = "fmax_hz") -> float:
    """Return the highest clock with wires in MHz."""
    return 1e-6 * float(one["with_wires"][name])


@claim(PAGE)
def arrays() -> Iterator[str]:
    """How area and clock go with the array."""
    small, middle, large = (array(side) for side in (8, 32, 64))
    yield (
        f"area per taxel stays within {100 * (area(middle) / area(small) - 1):.0f} % of that at 64 taxels, and the "
        f"highest clock is {100 * mega(middle) / mega(small):.0f} % of it"
    )
    more = area(large) / area(small) - 1
    assert more <= 0.1
    assert mega(large) < mega(small) / 2
    wired = large["with_wires"]
    lines = (wired["path_in_repeaters_s"] + wired["path_in_wires_s"]) / wired["path_s"]
    yield (
        f"area per taxel is {100 * more:.0f} % above that at 64 taxels (the aim, 10 %, is met), the highest clock "
        f"{100 * mega(large) / mega(small):.0f} % of it (the aim, half, is **missed**)"
    )
    yield f"{100 * lines:.0f} % of the path in lines and repeaters"
    yield f"{mega(large):.0f} MHz are still {mega(large) / 1.28:.0f} times the 1.28 MHz that"
    yield (f"in two: at most 2 x {mega(large):.0f} MHz (2 x {mega(large, 'between_flops_hz'):.0f} between flops alone)")
    repeater = read(SCALE)["repeater"]
    yield (
        f"in IHP a `{repeater['kind'].removeprefix('sg13g2_')}` every {repeater['spacing_um'] / 1e3:.1f} mm, "
        f"{1e9 * repeater['s_per_mm']:.2f} ns per mm"
    )


@claim(PAGE)
def cut() -> Iterator[str]:
    """What tiles and relay stations bring and cost."""
    small, large = array(8), array(64)
    best, sixteen, without = tiles(8, 2), tiles(16, 1), tiles(16, 0)
    assert f"{mega(best):.0f}" == f"{mega(small):.0f}"
    yield (
        f"have the clock of 8 x 8 alone, {mega(best):.0f} MHz (the aim, half of it, is met), at an area per taxel "
        f"{100 * (area(best) / area(small) - 1):.0f} % above it (the aim, 10 %, is met)"
    )
    yield (
        f"one station reach {mega(sixteen):.0f} MHz, {100 * mega(sixteen) / mega(small):.0f} %, at "
        f"{100 * (area(sixteen) / area(small) - 1):.0f} % more area"
    )
    yield f"of lines: {mega(without):.0f} MHz. With one it"
    for side, words in ((16, "{0:.1f} um2 a taxel ({1:.1f} %)"), (8, "it is {0:.0f} um2 a taxel ({1:.1f} %)")):
        cells = [tiles(side, relays)["cells_um2_per_taxel"] for relays in (0, 1)]
        yield words.format(cells[1] - cells[0], 100 * (cells[1] / cells[0] - 1))
    added = [area(one) - one["cells_um2_per_taxel"] for one in (tiles(s, n) for s in (8, 16) for n in range(3))]
    yield (
        f"Repeaters take {round(min(added), -1):.0f} to {round(max(added), -1):.0f} um2 a taxel in the tiles, "
        f"{area(large) - large['cells_um2_per_taxel']:.0f} in one array"
    )


@claim(PAGE)
def builds() -> Iterator[str]:
    """How large arrays are built and played."""
    measured = {one["side"]: one for one in read("benchmarks/results/scale_arrays.json")["results"]}
    ticks = {sim["simulator"]: sim["clocks"] // 64 for sim in measured[8]["simulations"]}
    yield f"plays the same {ticks['verilator']} ticks ({ticks['icarus']} in Icarus)"
    skins = read("benchmarks/results/scale_skins.json")["results"]
    (taxels,) = {skin["taxels"] for skin in skins}
    yield f"A skin of {taxels:,} taxels"


@claim("docs/reference/tiles.md")
def carried() -> Iterator[str]:
    """How many tiles one output carries."""
    rates = {bits: stored_table().population_hz("lcs", bits) / 64 for bits in (2, 6)}
    tile = 64 * 64 * rates[6]
    yield f"sends about {round(rates[6], -1):,.0f} events/s, a tile of 64 x 64 {tile / 1e6:.1f} million"
    yield (
        f"one output at 100 MHz carries {100e6 // tile:.0f} of them; at 2 b ({rates[2]:.0f} events/s a taxel) "
        f"{round(100e6 / (64 * 64 * rates[2]), -1):.0f}"
    )
    (taxels,) = {skin["taxels"] for skin in read("benchmarks/results/scale_skins.json")["results"]}
    yield f"has a measured skin of {taxels:,} taxels"
