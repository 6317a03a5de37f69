"""Tables of area, timing and power of netlists, layouts and FPGA designs."""

from __future__ import annotations

from functools import cache
from typing import Any

from docs.tables.write import ROOT, digits, filled, read, table
from eskin.skin.figures.readouts import LOOKS

EVENTS = "{?energy_per_event_j:1e12*.2f} | {?energy_per_lone_event_j:1e12*.2f}"
ON_TEXTURE = EVENTS + " | {?energy_per_texture_event_j:1e12*.2f}"
SCENARIOS = {"saturated": "event in every clock", "lone": "single event", "texture": "texture"}
EVENT_TITLES = "pJ per event: event in every clock | single event | texture"

CLOCKS_AN_EVENT = 7
"""Clocks per event of the four-phase link, with a receiver that answers at once."""


def reports(folder: str, pattern: str = "*.json") -> dict[str, dict[str, Any]]:
    """Return the reports in a folder of ``docs/data``, by name."""
    paths = sorted((ROOT / "docs/data" / folder).glob(pattern))
    return {path.stem: read(str(path.relative_to(ROOT))) for path in paths}


def named(result: dict[str, Any]) -> dict[str, Any]:
    """Return a result with names of readout, array and cells, and the agreement of both power methods."""
    ratios = [stretch["agreement"] for stretch in result.get("scenarios", {}).values()]
    return result | {
        "name": f"{filled('{readout:E}', result)} {result['frontend'] or ''}".strip(),
        "array": f"{result['rows']} x {result['columns']}",
        "cells": "IHP 130 nm" if result["process"].startswith("sg13g2") else "OSU 180 nm",
        "agreement": f"{min(ratios):.3f} to {max(ratios):.3f}" if ratios else "",
    }


@cache
def netlists() -> dict[str, dict[str, Any]]:
    """Return the reports of ``make asic`` by name."""
    found = {}
    for name, report in reports("asic", "*-*x*-*.json").items():
        config = report["configuration"]  # reports without power have these names there alone
        names = {"readout": config.get("encoding", "frame"), "process": report["library"]}
        wired = report.get("with_wires", {})
        both = report.get("power", {}) | {f"{key}, with wires": s for key, s in wired.get("scenarios", {}).items()}
        report = {key: config.get(key) for key in ("rows", "columns", "frontend")} | names | report
        found[name] = named(report | {"scenarios": both})
    order = list(LOOKS)

    def place(item: tuple[str, dict[str, Any]]) -> tuple[Any, ...]:
        one = item[1]
        return one["library"], one["rows"], order.index(one["readout"]), one["frontend"] or ""

    return dict(sorted(found.items(), key=place))


def asic_netlists() -> None:
    """Print area, speed and proofs of the netlists."""
    rows = []
    for report in netlists().values():
        fmax = [report["fmax_hz"][corner] for corner in ("slow", "typical", "fast") if corner in report["fmax_hz"]]
        rows.append(report | {"mhz": ", ".join(f"{hertz / 1e6:.0f}" for hertz in fmax)})
    table(
        "readout | array | cells | um2 per taxel | area share of flops | flops (with clock gate) | clock gates"
        " | MHz at slow, typical, fast corner | cells in the longest path"
        " | flops and outputs proved equal to the RTL | commit",
        rows,
        "{name} | {array} | {cells} | {area_um2_per_taxel:,.0f} | {sequential_area_share:100*.0f} %"
        " | {flops:,} ({gated_flops:,}) | {structure[clock_gates]} | {mhz} | {timing[typical][logic_depth]}"
        " | {equivalence[proved]:,} of {equivalence[of]:,} | {commit}",
    )


def asic_delivered() -> None:
    """Compare the netlist of ``make asic`` with the netlist of the delivered Verilog with clock gates."""
    published = netlists()["lcs-digital-8x8-ihp"]
    rows = [
        report | {"wired": report["with_wires"], "what": what, "gates": report["structure"]["clock_gates"]}
        for what, report in (("`make asic`", published), ("delivered Verilog", read("docs/data/asic/delivered.json")))
    ]
    table(
        f"8 x 8 LCS digital, IHP 130 nm | um2 per taxel | clock gates | idle, nW per taxel | {EVENT_TITLES}"
        " | with wires: idle | alone | on a texture | commit",
        rows,
        "{what} | {area_um2_per_taxel:,.0f} | {gates} | {idle_w_per_taxel:1e9*.1f} | "
        + ON_TEXTURE
        + " | {wired[idle_w_per_taxel]:1e9*.1f} | {wired[energy_per_lone_event_j]:1e12*.2f}"
        " | {wired[energy_per_texture_event_j]:1e12*.2f} | {commit}",
    )


def intuitive() -> None:
    """Compare our netlists with the analog INTUITIVE chip, for an array of the same size."""
    print(
        "| | process | contains | power without events, nW per taxel | um2 per taxel"
        " | pJ per event, an event in every clock | shortest time per event, ns |"
    )
    print("|---|---|---|---|---|---|---|")
    print("| INTUITIVE | 180 nm | taxels with their analog parts, arbiter, bus | 12.33 | 40,000 | | 600 |")
    for report in netlists().values():
        if report["rows"] == 12 and report["frontend"] == "analog":
            report["fastest_ns"] = CLOCKS_AN_EVENT / report["fmax_hz"]["typical"] * 1e9
            line = "| {name} | {cells} | only digital logic, no wires | {idle_w_per_taxel:1e9*.2f}"
            line += " | {area_um2_per_taxel:,.0f} | {energy_per_event_j:1e12*.2f} | {fastest_ns:.0f} |"
            print(filled(line, report))


def asic_power() -> None:
    """Print the power of the netlists, and the number of compared events."""
    table(
        "readout | array | cells | leakage, nW per taxel | no events, nW per taxel | no events, with wires | "
        + EVENT_TITLES
        + " | pJ with wires: event in every clock | single event | texture | events of netlist, of RTL"
        " | power by OpenSTA / by tables",
        [report for report in netlists().values() if "power" in report],
        "{name} | {array} | {cells} | {leakage_w_per_taxel:1e9*.1f} | {?idle_w_per_taxel:1e9*.1f}"
        " | {?with_wires[idle_w_per_taxel]:1e9*.1f} | "
        + ON_TEXTURE
        + " | {?with_wires[energy_per_event_j]:1e12*.2f} | {?with_wires[energy_per_lone_event_j]:1e12*.2f}"
        " | {?with_wires[energy_per_texture_event_j]:1e12*.2f}"
        " | {gate_level_events[netlist]:,} of {gate_level_events[rtl]:,} | {agreement}",
    )


def asic_windows() -> None:
    """Print the cost of closing windows in netlists of CW-LCS."""
    table(
        "readout | array | cells | windows closed, nW per taxel | windows closing, nW per taxel"
        " | closed, with wires | closing, with wires | pJ to close a window | pJ with wires",
        [report for report in netlists().values() if "closing_w_per_taxel" in report],
        "{name} | {array} | {cells} | {idle_w_per_taxel:1e9*.1f} | {closing_w_per_taxel:1e9*.1f}"
        " | {?with_wires[idle_w_per_taxel]:1e9*.1f} | {?with_wires[closing_w_per_taxel]:1e9*.1f}"
        " | {?energy_per_closed_window_j:1e12*.1f} | {?with_wires[energy_per_closed_window_j]:1e12*.1f}",
    )


def asic_glitches() -> None:
    """Print the energy of an event with and without cell delays."""
    rows = []
    for report in reports("asic/glitches").values():
        costs = [f"{1e12 * report[way][name]:.2f}" for name in SCENARIOS for way in ("no_delay", "delay")]
        added = [f"{report['added'][name]:.0%}" for name in SCENARIOS]
        cells = [word for pair in zip(costs[::2], costs[1::2], added, strict=True) for word in pair]
        rows.append([*(named(report)[key] for key in ("name", "array", "cells")), *cells, report["commit"]])
    titles = [f"{name}: pJ without delays | pJ with delays | increase" for name in SCENARIOS.values()]
    table(f"readout | array | cells | {' | '.join(titles)} | commit", rows)


def asic_targets() -> None:
    """Print targets and results for 8 x 8 LCS in 130 nm."""
    both = {"digital": netlists()["lcs-digital-8x8-ihp"], "analog": netlists()["lcs-analog-8x8-ihp"]}
    idle, leakage = ("idle_w_per_taxel", 1e9, "nW per taxel"), both["analog"]["leakage_w_per_taxel"]
    asked = [
        ("power without events, digital", 60e-9, "digital", *idle),
        ("power without events, analog (target: twice its leakage)", 2 * leakage, "analog", *idle),
    ]
    for text, most, key in (("an event in every clock", 6e-12, "event"), ("a single event", 15e-12, "lone_event")):
        asked += [(f"{text}, {name}", most, name, f"energy_per_{key}_j", 1e12, "pJ") for name in both]
    for name, most in (("digital", 2217.0), ("analog", 1485.0)):
        asked.append((f"area, {name}", most, name, "area_um2_per_taxel", 1.0, "um2 per taxel"))
    rows = []
    for text, most, name, key, unit, unit_name in asked:
        found = both[name][key]
        met = "met" if found <= most else "**missed**"
        rows.append([text, f"{digits(most * unit, 4)} {unit_name}", digits(found * unit, 4), met])
    table("8 x 8 LCS, 6 b, 130 nm, 1.28 MHz | target: at most | measured | result", rows)


def parity() -> None:
    """Print the area of one flip-flop as a fraction of a taxel."""
    rows = []
    for name in ("lcs-digital", "lcs-analog", "nlcs-digital"):
        netlist = netlists()[f"{name}-8x8-ihp"]
        flops = netlist["flops"] / netlist["rows"] / netlist["columns"]
        title = netlist["name"].replace(" ", ", ")
        rows.append([title, f"{flops:.1f}", f"{netlist['sequential_area_share'] / flops:.1%}"])
    table("8 x 8 taxels, IHP 130 nm | flops per taxel | area of one flop as a share of a taxel", rows)


def layout() -> None:
    """Print layouts in 130 nm and their checks."""
    rows = []
    for report in reports("layout").values():
        same, config = report["comparison"], report["configuration"]
        more = {
            "area": report["width_um"] * report["height_um"] / config["rows"] / config["columns"],
            "broken": len(report["rules"]["violations"]),
            "same": f"{same['transistors']:,} transistors equal" if same else "not compared",
            "cpu_s": sum(report["seconds"].values()),
        }
        rows.append(report | config | more)
    table(
        "readout | cells | size, um x um | um2 per taxel | area share of cells | rule violations"
        " | layout against netlist"
        " | flops and outputs equal to the RTL | processor time, s",
        rows,
        "{encoding:E}, {frontend}, {rows} x {columns} | {cells:,} | {width_um:.0f} x {height_um:.0f} | {area:,.0f}"
        " | {utilisation:100*.0f} % | {broken} in {rules[checked]} rules | {same}"
        " | {equivalence[proved]} of {equivalence[of]} | {cpu_s:.0f}",
    )


def layout_macros() -> None:
    """Print the checks of abstracts and timing models of the layouts."""
    rows = [
        report
        | report["configuration"]
        | {"differ": len(report["macro"]["differ"]), "mhz": 1e3 / report["macro"]["period_ns"]}
        for report in reports("layout").values()
        if report.get("macro")
    ]
    table(
        "readout | pins in the abstract | differences between abstract and layout | highest clock, MHz"
        " | largest difference between model and netlist, ns | commit",
        rows,
        "{encoding:E}, {frontend}, {rows} x {columns} | {macro[pins]} | {differ} | {mhz:.0f}"
        " | {macro[difference_ns]:.3f} | {commit}",
    )


def _fpga(classifier: bool, more_titles: str = "", more_cells: str = "") -> None:
    rows = []
    for name, report in reports("fpga").items():
        if (report["design"] == "classifier") == classifier:
            aims = ((aim, "met" if aim["met"] else "**missed**") for aim in report.get("aims", []))
            aimed = "; ".join(f"{aim['what']} {aim['wanted']:g}: {met}" for aim, met in aims)
            rows.append(report | {"name": name, "memory": f"{report['memory_bytes'] / 1024:g}", "aimed": aimed})
    table(
        "design | command | clock | LUT4 | flops | block RAMs | commit | date" + more_titles,
        rows,
        "{name} | `{command}` | {clock_hz:1e-6*.1f} MHz | {luts:,} | {used[TRELLIS_FF]:,} | {block_rams} ({memory} kB)"
        " | {commit} | {date}" + more_cells,
    )


def fpga_boards() -> None:
    """Print the FPGA resources of the board designs."""
    _fpga(classifier=False)


def fpga_classifier() -> None:
    """Print the FPGA resources of the classifier alone, with targets."""
    _fpga(True, " | targets", " | {aimed}")
