"""Energy of the whole chain, from touch to class, beside published classifiers."""

from typing import Any

from docs.tables.write import Rows, digits, filled, read
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.run import work_clocks

CHIPS = {"ihp": "IHP 130 nm", "osu": "OSU 180 nm"}
"""Cell libraries of the measured netlists."""


def chain(cells: str) -> dict[str, Any]:
    """Return the energy of a decision in parts, in joules, averaged over the recorded scans.

    Events, bins, spikes and clocks are those of ``make touch``; the energy of each comes from netlists, and that of a
    memory access from the macro's Liberty file.
    """
    touch, logic = read("docs/data/touch.json"), read(f"docs/data/asic/classifier-{cells}.json")
    readout = read(f"docs/data/asic/lcs-digital-8x8-{cells}.json")
    config = ChipConfig.from_dict(touch["chip"]).classifier
    scans = touch["images"]
    events, bins, spikes = (touch[name] / scans for name in ("events", "bins", "hidden_spikes"))
    second = touch["clocks"] / scans / config.clock_hz
    energies, reads = _energies(config, cells, "lcs", events, bins, spikes)
    memories = read("docs/data/asic/memories-ihp.json")
    idle = {
        "readout": readout["idle_w_per_taxel"] * readout["rows"] * readout["columns"],
        "logic": logic["idle_w"],
        "memories": sum(memories[name]["leakage_w"] for name in reads),
    }
    parts = {}
    for name, (events_j, ends_j) in energies.items():
        found = {"events_j": events_j, "ends_j": ends_j, "idle_j": idle[name] * second}
        parts[name] = found | {"decision_j": sum(found.values()), "event_j": events_j / events}
    every_clock = sum((touch["clocks"] / scans - count) * memories[name]["read_j"] for name, count in reads.items())
    return {
        "parts": parts,
        "decision_j": sum(part["decision_j"] for part in parts.values()),
        "event_j": sum(part["event_j"] for part in parts.values()),
        "events": events,
        "second": second,
        "every_clock_j": every_clock,
        "right": touch["right"],
        "scans": scans,
        "agreement": logic["agreement"],
        "area_um2": logic["area_um2"],
        "config": config,
        "flop_mm2": config.memory_bits * logic["flop_um2"] / 1e6,
    }


def _energies(
    config: ClassifierConfig, cells: str, encoder: str, events: float, bins: float, spikes: float
) -> tuple[dict[str, tuple[float, float]], dict[str, float]]:
    """Return the energy of events and of ends of bins in each part, and the reads of each memory.

    Numbers of events, bins and hidden spikes give joules; their rates per second give watts.
    """
    logic, memories = read(f"docs/data/asic/classifier-{cells}.json"), read("docs/data/asic/memories-ihp.json")
    readout, mean = read(f"docs/data/asic/{encoder}-digital-8x8-{cells}.json"), spikes / bins
    work = bins * work_clocks(config, mean / config.hidden, mean / config.hidden)  # linear in both
    reads = {"inputs": events * config.groups, "recurrent": spikes * config.groups}
    reads["neurons"] = bins * (config.hidden + config.classes) + spikes * config.classes
    energy = {name: count * memories[name]["read_j"] for name, count in reads.items()}
    found = {
        "readout": (readout["energy_per_texture_event_j"] * events, 0.0),
        "logic": (logic["energy_per_event_j"] * events, work * logic["energy_per_clock_of_work_j"]),
    }
    if cells == "ihp":
        found["memories"] = (energy["inputs"], energy["recurrent"] + energy["neurons"])
    return found, reads


def energy_parts() -> Rows:
    """Return the parts of the energy of a decision."""
    return [
        {"cells": name, "part": part} | {key: joules or None for key, joules in value.items()}
        for cells, name in CHIPS.items()
        for part, value in chain(cells)["parts"].items()
    ]


def energy_peers() -> Rows:
    """Yield energies a decision beside published ones, each with task and contents."""
    for cells, name in CHIPS.items():
        found = chain(cells)
        more = {"chip": name, "share": found["right"] / found["scans"]}
        more["memory"] = "weights in SRAM macros" if "memories" in found["parts"] else "no memories"
        text = "this project | {chip}, gates | texture of 6, {second:.2f} s, {events:,.0f} events | {share:.1%}"
        text += " | readout and 128-128-6 network, {memory}; no wires, clock tree, converters, pads"
        text += " | {decision_j:1e6*.1f} | {event_j:1e12*,.0f} pJ an event | this page"
        yield filled(text, found | more)
    board, touch = read("docs/data/fpga/player-embedded-ulx3s.json"), read("docs/data/touch.json")
    used = f"{board['luts']:,} LUT4, {board['block_rams']} block RAMs"
    contents = f"readout, serial link and a smaller network (128-64-3): {used}"
    clocks = f"{touch['clocks'] / touch['images']:,.0f} clocks a decision"
    yield ["this project", "ECP5 FPGA", *["the same"] * 2, contents, "no open power model", clocks, "this page"]
    for peer in read("docs/data/classifier/peers.json")["peers"]:
        energy = "not given" if peer["decision_j"] is None else digits(1e6 * peer["decision_j"], 3)
        link = f"[{peer['source'].split('/')[2].removeprefix('www.')}]({peer['source']})"
        facts = (peer[key] or "-" for key in ("name", "process", "task", "accuracy", "contents"))
        yield [*facts, energy, peer["given"], link]


def energy_clocks() -> dict[str, Any]:
    """Return values for the sentences of the page."""
    found, osu = chain("ihp"), chain("osu")
    config = found["config"]
    return {
        "groups": config.groups,
        "work": work_clocks(config, 0, 0),
        "every": 1e6 * found["every_clock_j"],
        "decision": 1e6 * found["decision_j"],
        "share": found["parts"]["memories"]["decision_j"] / found["decision_j"],
        "low": min(found["agreement"]),
        "high": max(found["agreement"]),
        "osu_low": min(osu["agreement"]),
        "osu_high": max(osu["agreement"]),
        "osu_area": osu["area_um2"] / 1e6,
        "area": found["area_um2"] / 1e6,
        "flops": found["flop_mm2"],
        "kbit": config.memory_bits / 1024,
    }
