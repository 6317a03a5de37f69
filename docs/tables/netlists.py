"""Tables of area, timing and power of netlists, layouts and FPGA designs."""

from functools import cache
from typing import Any

from docs.tables.write import ROOT, Rows, digits, filled, read
from eskin.model.links.four_phase import FourPhase
from eskin.skin.figures.readouts import LOOKS


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


def asic_netlists() -> Rows:
    """Yield area, speed and proofs of the netlists."""
    for report in netlists().values():
        fmax = [report["fmax_hz"][corner] for corner in ("slow", "typical", "fast") if corner in report["fmax_hz"]]
        yield report | {"mhz": ", ".join(f"{hertz / 1e6:.0f}" for hertz in fmax)}


def asic_delivered() -> Rows:
    """Return the netlist of ``make asic`` with the netlist of the delivered Verilog with clock gates."""
    published = netlists()["lcs-digital-8x8-ihp"]
    return [
        report | {"wired": report["with_wires"], "what": what, "gates": report["structure"]["clock_gates"]}
        for what, report in (("`make asic`", published), ("delivered Verilog", read("docs/data/asic/delivered.json")))
    ]


def intuitive() -> Rows:
    """Yield the analog INTUITIVE chip, and our netlists of an array of the same size."""
    yield "INTUITIVE | 180 nm | taxels with their analog parts, arbiter, bus | 12.33 | 40,000 |  | 600"
    for report in netlists().values():
        if report["rows"] == 12 and report["frontend"] == "analog":
            yield report | {"fastest_ns": FourPhase.clocks_per_event / report["fmax_hz"]["typical"] * 1e9}


def asic_targets() -> Rows:
    """Yield targets and results for 8 x 8 LCS in 130 nm."""
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
    for text, most, name, key, unit, unit_name in asked:
        found = both[name][key]
        met = "met" if found <= most else "**missed**"
        yield [text, f"{digits(most * unit, 4)} {unit_name}", digits(found * unit, 4), met]


def parity() -> Rows:
    """Yield the area of one flip-flop as a fraction of a taxel."""
    for name in ("lcs-digital", "lcs-analog", "nlcs-digital"):
        netlist = netlists()[f"{name}-8x8-ihp"]
        flops = netlist["flops"] / netlist["rows"] / netlist["columns"]
        title = netlist["name"].replace(" ", ", ")
        yield [title, f"{flops:.1f}", f"{netlist['sequential_area_share'] / flops:.1%}"]


def layout() -> Rows:
    """Yield layouts in 130 nm and their checks."""
    for report in reports("layout").values():
        same, config = report["comparison"], report["configuration"]
        more = {
            "area": report["width_um"] * report["height_um"] / config["rows"] / config["columns"],
            "broken": len(report["rules"]["violations"]) + len(report["electrical"]["violations"]),
            "levels": " or ".join(str(number) for number in sorted(set(report["clock_tree"]["levels"]))),
            "densest": max(report["electrical"]["density"].values()),
            "inputs": len(report["electrical"]["inputs"]),
            "same": f"{same['transistors']:,} transistors equal" if same else "not compared",
            "cpu_s": sum(report["seconds"].values()),
        }
        yield report | config | more


def fpga(classifier: bool) -> Rows:
    """Yield the FPGA resources of the board designs, or of the classifier alone, with targets."""
    for name, report in reports("fpga").items():
        if (report["design"] == "classifier") == classifier:
            aims = ((aim, "met" if aim["met"] else "**missed**") for aim in report.get("aims", []))
            aimed = "; ".join(f"{aim['what']} {aim['wanted']:g}: {met}" for aim, met in aims)
            flops = sum(number for kind, number in report["used"].items() if "FF" in kind)
            more = {"name": name, "memory": f"{report['memory_bytes'] / 1024:g}", "aimed": aimed}
            yield report | more | {"flops": f"{flops:,}" if flops else "in the LUT cells"}
