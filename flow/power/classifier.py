"""Compute the energy of a classifier: simulate the gates of its logic, and count the accesses to its memories."""

import json
import re
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eskin.cocotb_tests.bench.textures import scan
from eskin.flow import programs
from eskin.flow.asic.synthesis import cells_of
from eskin.flow.gatesim.flat_netlist import FlatNetlist, flatten
from eskin.flow.gatesim.models import models
from eskin.flow.liberty.library import Library
from eskin.flow.power.activity import DUMP, HALF_NS, read_dump
from eskin.flow.power.event_bench import Mismatch
from eskin.flow.power.liberty_power import LibertyPower
from eskin.flow.power.measure import PowerMeter, ScenarioPower
from eskin.flow.power.opensta_power import OpenstaPower
from eskin.model.classifier.chip import channels_of, simulate_chip
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.file import neuron_image, parameter_image, recurrent_image, row_image
from eskin.model.classifier.network import IntegerNetwork
from eskin.model.classifier.run import ClassifierRun, first_ready, simulate
from eskin.model.classifier.words import packed
from eskin.rtl import yosys
from eskin.rtl.classifier.core import Classifier
from eskin.rtl.classifier.memory import InputMemory, NeuronMemory, ParameterMemory, RecurrentMemory
from eskin.rtl.gates.clock_gates import FLOPS
from eskin.rtl.verilog import block_rtlil

BINS = 3
"""Bins of the simulation; the last one is measured, when recurrent spikes have begun."""

IDLE_CLOCKS = 256

MAX_APART = 0.1
"""Largest allowed difference of the two methods, as a share of the energy; in IHP cells they differ by up to 8 %."""


MEMORIES: dict[
    str,
    tuple[type[InputMemory | RecurrentMemory | NeuronMemory | ParameterMemory], Callable[[IntegerNetwork], list[int]]],
] = {
    "inputs": (InputMemory, lambda n: row_image(n.config, n.w_in, n.config.in_bits, n.config.input_words)),
    "recurrent": (RecurrentMemory, lambda n: recurrent_image(n, n.config.rec_bits)),
    "neurons": (NeuronMemory, neuron_image),
    "parameters": (ParameterMemory, parameter_image),
}
"""Memories of a classifier by the name of their instance, and the words that they hold."""

POTENTIALS = (
    "read_rtlil readout.il; hierarchy -check -top {top}; proc; memory_map {flops}; opt_clean; write_json a.json"
)
"""Yosys commands that turn the potentials of a lane into flops."""


@dataclass(frozen=True)
class Window:
    """Clocks of a simulation."""

    start: int
    clocks: int


def _memories(config: ClassifierConfig) -> dict[str, Any]:
    """Return the memories that a classifier has."""
    return {name: of for name, of in MEMORIES.items() if name != "parameters" or config.own_parameters}


def outside(config: ClassifierConfig) -> str:
    """Return the RTLIL of a classifier whose memories stand outside: their pins are ports."""
    block = Classifier(config)
    script = POTENTIALS.format(top=block.module_name, flops=FLOPS)
    design = json.loads(yosys.run(script, block_rtlil(block), "a.json"))
    top = design["modules"][block.module_name]
    for name, (memory, _) in _memories(config).items():
        del design["modules"][memory.module_name]
        cell = top["cells"].pop(name)
        for pin, bits in cell["connections"].items():
            if pin not in ("clk", "rst"):
                way = {"input": "output", "output": "input"}[cell["port_directions"][pin]]
                top["ports"][f"{name}_{pin}"] = {"direction": way, "bits": bits}
    files = {"a.json": json.dumps(design).encode()}
    return yosys.run(
        f"read_json a.json; hierarchy -check -top {block.module_name}; write_rtlil b.il", "", "b.il", files
    )


def play(
    network: IntegerNetwork,
    netlist: FlatNetlist,
    cells: str,
    offered: Sequence[tuple[int, int]],
    clocks: int,
    dumped: Window,
    folder: Path,
) -> tuple[Path, ClassifierRun]:
    """Simulate events on a netlist, compare with the golden model, and return the dump and the run of the model."""
    config = network.config
    width = config.clocks_per_bin
    memories = {
        name: (image(network), len(memory(config).read_data)) for name, (memory, image) in _memories(config).items()
    }
    images = memories | {"at": ([clock for clock, _ in offered] or [0], 64)}
    images["channel"] = ([channel for _, channel in offered] or [0], 32)
    for name, (words, bits) in images.items():
        lines = "".join(f"{word & (1 << bits) - 1:x}\n" for word in words)
        (folder / f"{name}.hex").write_text(lines)
    given = {"clk": "clk", "rst": "rst", "event_channel": f"channel[n][{max(config.channel_bits, 1) - 1}:0]"}
    given |= {f"{name}_read_data": f"{name}_word" for name in memories}
    driven = {"event_valid", "bin_end"}
    wires = [
        (port.name, len(port.nets))
        for port in netlist.ports
        if port.name not in given and (port.direction == "output" or port.name in driven)
    ]
    pins = [
        f".{port.name}({given.get(port.name, port.name if port.direction == 'output' or port.name in driven else 0)})"
        for port in netlist.ports
    ]
    first_edge = 2 * HALF_NS * (dumped.start + 1)
    bench = programs.filled(
        "classifier.v",
        events=len(offered),
        memories=memories,
        wires=wires,
        pins=", ".join(pins),
        width=width,
        top=netlist.top,
        clocks=clocks,
        before=first_edge - HALF_NS - 1,
        inside=2 * HALF_NS * dumped.clocks + 6,
        file=DUMP,
    )
    said = programs.icarus([bench, netlist.verilog(gather=True), cells], "play", folder)
    run = simulate(network, offered, range(width - 1, clocks, width), clocks)
    _hold(run, config, said)
    return folder / DUMP, run


def _hold(run: ClassifierRun, config: ClassifierConfig, said: str) -> None:
    """Raise Mismatch if a simulation differs from the model in events, classes, evidence, or their clocks."""
    taken = [int(clock) for clock in re.findall(r"^event (\d+)$", said, re.MULTILINE)]
    classes = [(int(c), int(k), int(e, 16)) for c, k, e in re.findall(r"^class (\d+) (\d+) (\w+)$", said, re.MULTILINE)]
    wanted = [
        (clock, bin_.winner, packed(bin_.evidence, config.evidence_bits))
        for clock, bin_ in zip(run.valid, run.bins, strict=True)
    ]
    if taken != run.accepted or classes != wanted[: len(classes)] or len(classes) < len(wanted) - 1:
        text = f"the netlist of the classifier takes {len(taken)} events and gives {len(classes)} classes, the model "
        raise Mismatch(
            f"{text}{len(run.accepted)} and {len(wanted)}, or in other clocks", len(taken), len(run.accepted)
        )


def measure(chip: ChipConfig, network: IntegerNetwork, library: Library) -> dict[str, Any]:
    """Return energies of a classifier's logic, without wires and memories, as JSON content.

    An embedded texture slides over the array; its events go through the classifier for ``BINS`` bins.
    """
    config = chip.classifier
    width = config.clocks_per_bin
    network = IntegerNetwork(**(vars(network) | {"config": config}))
    clocks = BINS * width + width // 2
    readout = chip.readout
    samples = scan(readout.rows, readout.columns, readout.sample_bits, 0)[: -(-clocks // readout.clocks_per_sample)]
    run = simulate_chip(chip, network, samples, clocks)
    offered = list(zip(run.events["t"].tolist(), channels_of(chip, run.events).tolist(), strict=True))
    text = cells_of(Classifier(config), outside(config), library)
    flat = flatten(text, Classifier.module_name, library.content)
    cells = models(library, {cell.kind for cell in flat.cells})
    tables = LibertyPower(flat, library, {})
    meter = PowerMeter(tables, OpenstaPower(flat, library, {}), config.clock_hz, MAX_APART)
    with tempfile.TemporaryDirectory() as name:
        ready = first_ready(config, -1) + 8
        dump, _ = play(network, flat, cells, [], ready + IDLE_CLOCKS + 8, Window(ready, IDLE_CLOCKS), Path(name))
        idle = meter.measure("idle", read_dump(dump, HALF_NS + 1, IDLE_CLOCKS, flat.nets), 0)
        begin, end = run.classifier.valid[BINS - 2] + 1, run.classifier.ended[BINS - 1]
        whole = Window(begin, run.classifier.valid[BINS - 1] + 1 - begin)
        dump, _ = play(network, flat, cells, offered, whole.start + whole.clocks + 8, whole, Path(name))
        activity = read_dump(dump, HALF_NS + 1, whole.clocks, flat.nets)
        events = sum(begin <= clock <= end for clock in run.classifier.accepted)
        taking, working = Window(begin, end + 1 - begin), Window(end + 1, run.classifier.valid[BINS - 1] - end)
        busy = meter.measure("events", activity.part(0, taking.clocks), events)
        work = meter.measure("end of a bin", activity.part(taking.clocks, working.clocks), 0)
    second = 1 / config.clock_hz

    def added(window: Window, power: ScenarioPower) -> dict[str, float]:
        """Return the energy that a window adds to an idle classifier, by the tables and by OpenSTA."""
        spent = {"by_tables": power.power_w - idle.power_w, "by_opensta": power.by_opensta_w - idle.by_opensta_w}
        return {name: watts * window.clocks * second for name, watts in spent.items()}

    of_events, of_work = added(taking, busy), added(working, work)
    spikes = [int(bin_.spikes.sum()) for bin_ in run.classifier.bins[BINS - 2 : BINS]]
    return {
        "network": {"inputs": config.inputs, "hidden": config.hidden, "classes": config.classes, "lanes": config.lanes},
        "library": library.name,
        "supply_v": library.voltage_v,
        "clock_hz": config.clock_hz,
        "area_um2": sum(library.cells[cell.kind].area_um2 for cell in flat.cells),
        "flop_um2": min(library.cells[cell.kind].area_um2 for cell in flat.cells if library.cells[cell.kind].flop),
        "cells": len(flat.cells),
        "idle_w": idle.power_w,
        "leakage_w": idle.leakage_w,
        "energy_per_event_j": of_events["by_tables"] / events,
        "energy_per_event_by_opensta_j": of_events["by_opensta"] / events,
        "energy_per_clock_of_work_j": of_work["by_tables"] / working.clocks,
        "energy_per_clock_of_work_by_opensta_j": of_work["by_opensta"] / working.clocks,
        "events": events,
        "work_clocks": working.clocks,
        "hidden_spikes": spikes,
        "agreement": [one.agreement for one in (idle, busy, work)],
    }
