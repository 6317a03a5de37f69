"""Area, timing and power of netlists, and the layout."""

from __future__ import annotations

import json
from typing import Any

from docs.tables.written import ENCODERS, ROOT, digits, markdown, read, table


def energy(result: dict[str, Any], name: str) -> str:
    """Return an energy of a result in picojoules, a dash where it has none."""
    value = result.get(f"energy_per_{name}event_j")
    return "-" if value is None else f"{1e12 * value:.2f}"


def nanowatts(result: dict[str, Any], name: str) -> str:
    """Return a power of a result, a dash where it has none."""
    return f"{1e9 * result[name]:.1f}" if name in result else "-"


def netlists() -> dict[str, dict[str, Any]]:
    """Return the reports of ``make asic`` that are kept, by name: libraries apart, then by size and readout."""
    found = {}
    for path in (ROOT / "docs/data/asic").glob("*-*x*-*.json"):
        report = json.loads(path.read_text())
        kept = report["configuration"]  # where no power was measured the report has it there alone
        names = {"readout": kept.get("encoding", "frame"), "process": report["library"], "frontend": ""}
        found[path.stem] = names | {name: kept.get(name) for name in ("rows", "columns", "frontend")} | report

    def order(item: tuple[str, dict[str, Any]]) -> tuple[Any, ...]:
        report = item[1]
        names = ["lcs", "cw-lcs", "nlcs", "frame"]
        return (report["library"], report["rows"], names.index(report["readout"]), report["frontend"])

    return dict(sorted(found.items(), key=order))


def cells_of(result: dict[str, Any]) -> str:
    """Return what the cells of a result are."""
    return {"sg13g2": "IHP 130 nm"}.get(result["process"].split("_")[0], "OSU 180 nm")


def named(result: dict[str, Any]) -> str:
    """Return the readout of a result in words."""
    return " ".join([(ENCODERS | {"frame": "frames"})[result["readout"]], result["frontend"]]).strip()


@table
def asic_netlists() -> str:
    """What netlists are made of, how fast they are, and what is proved of them."""
    rows = []
    for report in netlists().values():
        fmax, path = report["fmax_hz"], report["timing"]["typical"]["logic_depth"]
        corners = [fmax[corner] for corner in ("slow", "typical", "fast") if corner in fmax]
        rows.append(
            [
                named(report),
                f"{report['rows']} x {report['columns']}",
                cells_of(report),
                f"{report['area_um2_per_taxel']:,.0f}",
                f"{100 * report['sequential_area_share']:.0f} %",
                f"{report['flops']:,} ({report['gated_flops']:,})",
                str(report["structure"]["clock_gates"]),
                ", ".join(f"{hertz / 1e6:.0f}" for hertz in corners),
                str(path),
                "{proved:,} of {of:,}".format(**report["equivalence"]),
                report["commit"],
            ]
        )
    head = ["readout", "array", "cells", "um2 per taxel", "flops' share", "flops (gated)", "clock gates"]
    return markdown([*head, "MHz slow, typical, fast", "cells in the path", "points proved", "commit"], rows)


@table
def asic_power() -> str:
    """What the same netlists draw, and how many events they were held to the model in."""
    rows = []
    for report in netlists().values():
        if "power" not in report:
            continue
        wired, events = report["with_wires"], report["gate_level_events"]
        ratios = [s["agreement"] for power in (report["power"], wired.get("scenarios", {})) for s in power.values()]
        rows.append(
            [
                named(report),
                f"{report['rows']} x {report['columns']}",
                cells_of(report),
                f"{1e9 * report['leakage_w_per_taxel']:.1f}",
                *(nanowatts(result, "idle_w_per_taxel") for result in (report, wired)),
                *(energy(report, name) for name in ("", "lone_", "texture_")),
                *(energy(wired, name) for name in ("", "lone_")),
                f"{events['netlist']:,} of {events['rtl']:,}",
                f"{min(ratios):.3f} to {max(ratios):.3f}",
            ]
        )
    head = ["readout", "array", "cells", "leakage, nW a taxel", "idle", "with wires", "pJ an event, one in every clock"]
    head += ["alone", "on a texture", "with wires, one in every clock", "alone", "events, netlist of RTL"]
    return markdown([*head, "OpenSTA by tables"], rows)


@table
def asic_windows() -> str:
    """What closing windows cost: netlists of CW-LCS."""
    rows = []
    for report in netlists().values():
        if "closing_w_per_taxel" in report:
            both = report, report["with_wires"]
            taxel = [nanowatts(result, f"{name}_w_per_taxel") for result in both for name in ("idle", "closing")]
            joules = [result.get("energy_per_closed_window_j") for result in both]
            window = ["-" if value is None else f"{1e12 * value:.1f}" for value in joules]
            size = f"{report['rows']} x {report['columns']}"
            rows.append([named(report), size, cells_of(report), *taxel, *window])
    head = ["readout", "array", "cells", "idle, nW a taxel", "closing", "idle, with wires", "closing"]
    return markdown([*head, "pJ a closed window", "with wires"], rows)


@table
def asic_targets() -> str:
    """What 8 x 8 LCS in 130 nm should cost, and what it does."""
    digital, analog = netlists()["lcs-digital-8x8-ihp"], compared()["IHP 130 nm", "LCS analog", "none"]
    leaks = 2 * analog["leakage_w_per_taxel"]
    asked = [
        ("idle, digital", 60e-9, digital["idle_w_per_taxel"], 1e9, "nW per taxel"),
        ("idle, analog: twice its leakage", leaks, analog["idle_w_per_taxel"], 1e9, "nW per taxel"),
        *(
            (f"an event {how}, {name}", most, report[f"energy_per_{key}event_j"], 1e12, "pJ")
            for how, key, most in (("in every clock", "", 6e-12), ("alone", "lone_", 15e-12))
            for name, report in (("digital", digital), ("analog", analog))
        ),
        ("area, digital", 2217.0, digital["area_um2_per_taxel"], 1.0, "um2 per taxel"),
        ("area, analog", 1485.0, analog["area_um2"] / 64, 1.0, "um2 per taxel"),
    ]
    rows = [
        [what, f"{digits(most * unit, 4)} {name}", digits(found * unit, 4), "met" if found <= most else "**missed**"]
        for what, most, found, unit, name in asked
    ]
    return markdown(["8 x 8 LCS, 6 b, 130 nm, 1.28 MHz", "at most", "measured", ""], rows)


def compared() -> dict[tuple[str, str, str], dict[str, Any]]:
    """Return the power of the netlists that the power model compares, by cells, readout and wires."""
    found: list[dict[str, Any]] = []
    for report in netlists().values():
        if (
            "power" in report
            and report["rows"] == 8
            and (report["frontend"], report["readout"]) in (*(("analog", "lcs"), ("analog", "nlcs"), ("", "frame")),)
        ):
            found += [report | {"scenarios": report["power"]}, report["with_wires"]]
    kept = {(cells_of(one), named(one), "estimated" if one["pitch_um"] else "none"): one for one in found}
    return dict(sorted(kept.items()))


@table
def gate_power() -> str:
    """What the netlists draw that the power model compares, without and with estimated wires."""
    rows = []
    for (cells, readout, wires), result in compared().items():
        ratios = [stretch["agreement"] for stretch in result["scenarios"].values()]
        rows.append(
            [
                *(readout, f"{result['rows']} x {result['columns']}", cells, wires),
                *(f"{1e9 * result[name]:.2f}" for name in ("idle_w_per_taxel", "leakage_w_per_taxel")),
                *(energy(result, name) for name in ("", "lone_", "texture_")),
                f"{min(ratios):.3f} to {max(ratios):.3f}",
            ]
        )
    head = [
        "readout",
        "array",
        "cells",
        "wires",
        "idle nW a taxel",
        "leakage",
        "pJ an event, one in every clock",
        "alone",
    ]
    return markdown([*head, "on a texture", "OpenSTA by tables"], rows)


@table
def power_measured() -> str:
    """What becomes of the comparison where the logic is that of netlists instead of the published energy."""
    names = ENCODERS | {"frame": "frames"}

    def parts(path: str) -> dict[str, Any]:
        return dict(read(path)["modes"]["consistent"][1])

    def micro(watts: float) -> str:
        return digits(1e6 * watts, 3)

    before, rows = parts("docs/data/fig6.json"), []
    for library, cells in measured_libraries():
        after = parts(f"docs/data/asic/{library}/fig6.json")
        for readout in ("lcs", "nlcs", "frame"):
            old, new = before[readout], after[readout]
            name = names[readout] if readout == "frame" else f"{names[readout]} analog"
            report = compared()[f"{'IHP' if library == 'ihp' else 'OSU'} {cells}", name, "none"]
            published = old["converter_parts"].get("logic", 0.0)
            rows.append(
                [
                    f"{names[readout]}, {cells}",
                    micro(published) if published else "none",
                    micro(new["converter_parts"]["logic"]),
                    micro(64 * report["leakage_w_per_taxel"]),
                    *(micro(found["total"]) for found in (old, new)),
                    *("" if readout == "frame" else by_frames(found, readout) for found in (before, after)),
                ]
            )
    head = ["6 b, 0.92 mV, uW", "logic at 435 fJ an event", "logic measured", "of which leakage", "total before", "now"]
    return markdown([*head, "by frames before", "now"], rows)


def measured_libraries() -> list[tuple[str, str]]:
    """Return the libraries in which the logic of all three readouts is measured."""
    both = (("ihp", "130 nm"), ("osu", "180 nm"))
    return [one for one in both if (ROOT / "docs/data/asic" / one[0] / "fig6.json").exists()]


def by_frames(parts: dict[str, Any], readout: str) -> str:
    """Return what a readout draws by what frames draw."""
    return digits(parts[readout]["total"] / parts["frame"]["total"], 3)


@table
def low_power() -> str:
    """What readouts of 8 x 8 taxels cost in 130 nm, idle and by the event; LCS before it was written for gates too."""
    before = {row["readout"]: row for row in read("docs/data/asic/low_power.json")["readouts"]}
    rows, watts = [], ("idle_w_per_taxel", "leakage_w_per_taxel")
    for report in netlists().values():
        if (cells_of(report), report["rows"]) != ("IHP 130 nm", 8):
            continue
        power = compared().get((cells_of(report), named(report), "none"), report)
        if old := before.get(named(report)):
            idle = "-" if old["idle_nw"] is None else f"{old['idle_nw']:,.1f}"
            leakage = "-" if old["leakage_nw"] is None else f"{old['leakage_nw']:.1f}"
            rows.append(
                [f"{named(report)}, before", f"{old['area_um2']:,}", f"{old['flops']:,} (0)", "0", idle, leakage]
            )
            rows[-1] += ["-", "-"]
        rows.append(
            [
                named(report),
                f"{report['area_um2_per_taxel']:,.0f}",
                f"{report['flops']:,} ({report['gated_flops']:,})",
                str(report["structure"]["clock_gates"]),
                *(f"{1e9 * power[name]:.1f}" if name in power else "-" for name in watts),
                *(energy(power, name) for name in ("", "lone_")),
            ]
        )
    head = ["8 x 8, 6 b, 130 nm", "um2 per taxel", "flops (gated)", "clock gates", "idle, nW a taxel", "leakage"]
    return markdown([*head, "pJ an event, one in every clock", "alone"], rows)


@table
def frame_gates() -> str:
    """The frame readout beside the others, in gates."""
    frame = netlists()["frame-8x8-ihp"]
    rows = []
    for encoding, name in ENCODERS.items():
        both = [netlists()[f"{encoding}-{frontend}-8x8-ihp"] for frontend in ("digital", "analog")]
        rows.append(
            [name, *(f"{one['flops']:,}" for one in both), *(f"{one['area_um2_per_taxel']:,.0f}" for one in both)]
        )
    rows.append(["frames", f"{frame['flops']:,}", "", f"{frame['area_um2_per_taxel']:,.0f}", ""])
    fronts = ("digital", "analog")
    head = ["readout", *(f"flops, {front}" for front in fronts), *(f"um2 per taxel, {front}" for front in fronts)]
    return markdown(head, rows)


@table
def layout() -> str:
    """Layouts in 130 nm rules, and what was checked."""
    rows = []
    for path in sorted((ROOT / "docs/data/layout").glob("*.json")):
        said = json.loads(path.read_text())
        config, rules, compared = said["configuration"], said["rules"], said["comparison"]
        rows.append(
            [
                f"{ENCODERS[config['encoding']]}, {config['frontend']}, {config['rows']} x {config['columns']}",
                f"{said['cells']:,}",
                f"{said['width_um']:.0f} x {said['height_um']:.0f}",
                f"{said['width_um'] * said['height_um'] / config['rows'] / config['columns']:,.0f}",
                f"{100 * said['utilisation']:.0f} %",
                f"{len(rules['violations'])} in {rules['checked']} rules",
                f"{compared['transistors']:,} transistors equal" if compared else "not compared",
                f"{said['equivalence']['proved']} of {said['equivalence']['of']}",
                f"{sum(said['seconds'].values()):.0f}",
            ]
        )
    head = ["readout", "cells", "um x um", "um^2 a taxel", "cells' share", "violations", "netlist in the layout"]
    return markdown([*head, "points equal to the RTL", "processor s"], rows)
