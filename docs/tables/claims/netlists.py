"""What the pages of netlists, of low power and of the layout claim."""

from __future__ import annotations

import re
from collections.abc import Iterator

from docs.tables.claims import claim
from docs.tables.netlists import netlists
from docs.tables.written import read

ASIC, LOW_POWER, LAYOUT = "docs/results/asic.md", "docs/design/low_power.md", "docs/results/layout.md"


@claim(ASIC)
def two_ways() -> Iterator[str]:
    """Where OpenSTA and the tables differ too much."""
    said = netlists()["cw-lcs-analog-8x8-osu"]["difference"]
    apart, allowed = re.findall(r"[\d.]+(?= %)", said)
    assert said.startswith("closing")
    yield f"while its windows close they differ by {apart} %, where {allowed} % are allowed"


@claim(ASIC)
def windows() -> Iterator[str]:
    """What an event of CW-LCS costs."""
    found = netlists()["cw-lcs-analog-8x8-ihp"]
    window, wired = (1e12 * one["energy_per_closed_window_j"] for one in (found, found["with_wires"]))
    yield f"alone it takes {1e12 * found['energy_per_lone_event_j']:.1f} pJ in the clocks that follow"
    yield f"and then {window:.0f} pJ until its window is closed ({wired:.0f} with wires)"


@claim(LOW_POWER)
def flops() -> Iterator[str]:
    """Flops of a taxel, and how often a row leaks."""
    closing, leaking = (netlists()[f"{name}-digital-8x8-ihp"] for name in ("cw-lcs", "nlcs"))
    config = leaking["configuration"]
    yield f"flops of {closing['flops'] / 64:.0f} a taxel at a period of {closing['configuration']['window_period']}"
    share = 1 / (config["leak_period"] * config["clocks_per_sample"])
    yield f"once in {config['leak_period']} sample ticks: {100 * share:.3f} % of the clocks"


@claim(LAYOUT)
def laid_out() -> Iterator[str]:
    """The last line of ``make layout``, and the layouts in words."""
    kept = read("docs/data/layout/lcs-digital-2x2-6b.json")
    assert kept["comparison"]["equal"]
    yield (
        f"layout: {kept['name']}, {kept['cells']} cells, {kept['width_um']:.0f} x {kept['height_um']:.0f} um, "
        f"{len(kept['rules']['violations'])} violations, netlist equal"
    )
    large = read("docs/data/layout/lcs-digital-8x8-6b.json")
    assert not large["comparison"]
    yield f"among {large['cells']:,} cells"


@claim("docs/reference/frame.md")
def smaller() -> Iterator[str]:
    """How much smaller the frame readout is."""
    frame = netlists()["frame-8x8-ihp"]["area_um2_per_taxel"]
    times = [netlists()[f"{name}-digital-8x8-ihp"]["area_um2_per_taxel"] / frame for name in ("lcs", "cw-lcs", "nlcs")]
    yield f"The frame readout is {min(times):.0f} to {max(times):.0f} times smaller than those"
