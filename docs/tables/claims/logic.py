"""What the page of the power model claims of logic that is measured on netlists."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any

from docs.tables.claims import claim
from docs.tables.claims.power import PAGE, consistent, parts, ratio
from docs.tables.netlists import by_frames, compared, netlists
from docs.tables.written import digits, read
from model.power.equations import PowerModel
from model.power.rates import stored_table
from model.power.study import FIG6_NOISE_V
from model.power.synthesis import SynthesisReport

CELLS = {"ihp": "IHP 130 nm", "osu": "OSU 180 nm"}
Change = Callable[[dict[str, Any]], dict[str, Any]]


def report(cells: str, readout: str, wires: str = "none") -> dict[str, Any]:
    """Return the power of a netlist that the model compares."""
    return compared()[CELLS[cells], readout, wires]


def measured(cells: str, wires: str = "none", change: Change = dict) -> PowerModel:
    """Return the model whose logic is that of the netlists, each changed in some way."""
    names = {"lcs": "LCS analog", "nlcs": "N-LCS analog", "frame": "frames"}
    gates = {name: SynthesisReport.from_dict(change(report(cells, readout, wires))) for name, readout in names.items()}
    return dataclasses.replace(consistent(), gates=gates)


def ratios(model: PowerModel) -> list[float]:
    """Return what LCS and N-LCS cost by frames at the middle noise of Fig. 6."""
    return [ratio(model, readout, noise=FIG6_NOISE_V[1]) for readout in ("lcs", "nlcs")]


def both(readout: str, name: str, unit: float) -> list[float]:
    """Return a result of a readout in both libraries."""
    return [unit * report(cells, readout)[name] for cells in CELLS]


@claim(PAGE)
def with_netlists() -> Iterator[str]:
    """The comparison with measured logic."""
    found = {cells: parts(f"docs/data/asic/{cells}/fig6.json") for cells in CELLS}
    lcs, nlcs = ([float(by_frames(one, name)) for one in found.values()] for name in ("lcs", "nlcs"))
    assert min(lcs + nlcs) > 1
    yield f"LCS costs {lcs[0]:.0f} times (130 nm) or {lcs[1]:.0f} times (180 nm)"
    yield f"N-LCS {nlcs[0]:.1f} or {nlcs[1]:.1f} times. All three"
    logic = {name: [1e6 * one[name]["converter_parts"]["logic"] for one in found.values()] for name in parts()}
    yield f"which had no logic before, by {logic['frame'][0]:.1f} or {logic['frame'][1]:.1f} uW"
    leakage = [64 * both(readout, "leakage_w_per_taxel", 1e6)[0] for readout in ("LCS analog", "N-LCS analog")]
    yield (
        f"{leakage[0]:.2f} of {digits(logic['lcs'][0], 3)} uW of LCS, "
        f"{leakage[1]:.2f} of {digits(logic['nlcs'][0], 3)} uW of N-LCS"
    )
    leaks = both("LCS analog", "leakage_w_per_taxel", 1)
    yield f"180 nm cells leak {leaks[1] / leaks[0]:.1f} of that"
    idle = [both(readout, "idle_w_per_taxel", 1e9) for readout in ("LCS analog", "N-LCS analog")]
    yield (
        f"An idle taxel of LCS draws {idle[0][0]:.0f} nW (130 nm) or {idle[0][1]:.0f} nW (180 nm), "
        f"one of N-LCS {idle[1][0]:.0f} or {idle[1][1]:.0f} nW"
    )
    names = "energy_per_event_j", "energy_per_lone_event_j"
    energies = [[both(readout, name, 1e12) for name in names] for readout in ("LCS analog", "N-LCS analog")]
    ends = [(min(e[0][i] for e in energies), max(e[1][i] for e in energies)) for i in range(2)]
    assert ends[1][1] == energies[0][1][1]  # the most is that of LCS alone
    yield (
        f"an event {ends[0][0]:.1f} to {ends[0][1]:.0f} pJ in 130 nm and "
        f"{ends[1][0]:.0f} to {ends[1][1]:.0f} pJ in 180 nm"
    )


@claim(PAGE)
def otherwise() -> Iterator[str]:
    """The comparison with other choices of what is measured."""
    dac = parts("docs/data/asic/ihp/fig6.json")["nlcs"]["converter_parts"]["dac"]
    filter_w = parts()["nlcs"]["converter_parts"]["decay_filter"]
    yield (
        f"the model charges a DAC, {1e9 * dac:.0f} nW, in the place of the published analog decay filter, "
        f"{1e6 * filter_w:.2f} uW; V-to-I"
    )
    config = netlists()["nlcs-analog-8x8-ihp"]["configuration"]
    ticks = 64 * config["sample_rate_hz"] / config["leak_period"]
    more = dac * ticks / stored_table().population_hz("nlcs", 6)
    assert report("ihp", "N-LCS analog")["leak"] == "digital"
    yield f"decay ticks too, {round(ticks, -4):,.0f} times a second in all, would add {1e9 * more:.0f} nW"
    filtered = [ratios(measured(cells, change=lambda found: found | {"leak": "analog"}))[1] for cells in CELLS]
    yield f"With filter and netlist both, N-LCS would cost {filtered[0]:.1f} or {filtered[1]:.1f} times"
    wired = [ratios(measured(cells, "estimated")) for cells in CELLS]
    yield (
        f"With wires in all three it would be {wired[0][0]:.1f} and {wired[0][1]:.1f} in 130 nm, "
        f"{wired[1][0]:.1f} and {wired[1][1]:.1f} in 180 nm"
    )

    def textured(found: dict[str, Any]) -> dict[str, Any]:
        energy = found["energy_per_texture_event_j"]
        return found | {"energy_per_event_j": energy, "energy_per_lone_event_j": energy}

    texture, alone = (both("LCS analog", f"energy_per_{name}_event_j", 1e12) for name in ("texture", "lone"))
    first, second = zip(texture, alone, strict=True)
    yield "{:.1f} pJ against {:.1f} alone in 130 nm, {:.0f} against {:.0f} in 180 nm".format(*first, *second)
    lcs = [ratios(measured(cells, change=textured))[0] for cells in CELLS]
    yield f"With these LCS would cost {lcs[0]:.1f} or {lcs[1]:.1f} times what frames cost"


@claim(PAGE)
def tools() -> Iterator[str]:
    """What OpenSTA says of a netlist without gates, and leakage by state."""
    before = {row["readout"]: row for row in read("docs/data/asic/low_power.json")["readouts"]}
    yield f"The {before['LCS digital']['idle_nw']:,} nW an idle taxel that were found with it before any gating"
    more = [
        one["power"]["saturated"]["leakage_w"] / one["leakage_w"] - 1
        for one in netlists().values()
        if "saturated" in one.get("power", {})
    ]
    yield f"by state it is up to {100 * max(more):.0f} % more while all taxels fire"
    lcs, closing = report("ihp", "LCS analog"), netlists()["cw-lcs-analog-8x8-ihp"]
    yield (
        f"On its netlist (analog, 130 nm) an event costs {1e12 * closing['energy_per_texture_event_j']:.1f} pJ on a "
        f"texture where one of LCS costs {1e12 * lcs['energy_per_texture_event_j']:.1f}, and a taxel leaks "
        f"{1e9 * closing['leakage_w_per_taxel']:.0f} nW instead of {1e9 * lcs['leakage_w_per_taxel']:.0f}"
    )
