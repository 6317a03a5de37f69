"""Write the timing model (Liberty) of a placed block from its cells and wires with OpenSTA, and read it back."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eskin.flow import programs
from eskin.flow.liberty.library import Library
from eskin.flow.macro.characterise import GRID, LOADS_PF, SLEWS_NS

PERIOD_NS = 100.0

WIRES = {"m1": (0.32, 25.7784e-6, 40.567e-6), "m2": (0.37, 16.9423e-6, 37.759e-6), "m3": (0.38, 12.3729e-6, 40.989e-6)}
"""Width of the routed wires in um, capacitance in pF per um2 and of each edge in pF per um: widths of the placement,
capacitances of SkyWater's LEF file of the routing layers. Coupling to neighbours is not in them."""

WRONG = r"\b(Error|Warning)\b"
NUMBER = r"(-?[\d.]+)"
TIMES = re.compile(rf"(?:r|\^) {NUMBER}:{NUMBER} (?:f|v) {NUMBER}:{NUMBER}")


class NoModel(RuntimeError):
    """Raised for a block with a path from an input to an output without a flop."""


@dataclass(frozen=True)
class Block:
    """A placed block."""

    name: str
    # inputs, outputs: ports; ``clk`` is among the inputs
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    # by instance: kind, and wire of each pin
    cells: Mapping[str, tuple[str, Mapping[str, str]]]
    wires_pf: Mapping[str, float]  # wire capacitance of each net
    width_um: float
    height_um: float

    @property
    def data(self) -> tuple[str, ...]:
        """Inputs without the clock."""
        return tuple(name for name in self.inputs if name != "clk")

    def verilog(self) -> str:
        """Return the netlist as Verilog."""
        ports = [f"input {name}" for name in self.inputs] + [f"output {name}" for name in self.outputs]
        lines = [f"module {self.name}({', '.join(ports)});"]
        for name, (kind, pins) in self.cells.items():
            lines.append(f"  {kind} {name} ({', '.join(f'.{pin}({wire})' for pin, wire in pins.items())});")
        return "\n".join([*lines, "endmodule\n"])

    def ends(self, library: Library) -> dict[str, list[tuple[str, str]]]:
        """Return the instance and pin of each cell at each net; the driver first."""
        ends: dict[str, list[tuple[str, str]]] = {}
        for name, (kind, pins) in self.cells.items():
            for pin, wire in pins.items():
                place = 0 if pin in library.cells[kind].outputs else len(ends.get(wire, []))
                ends.setdefault(wire, []).insert(place, (name, pin))
        return ends

    def spef(self, library: Library) -> str:
        """Return the wire capacitances in SPEF format, without resistances."""
        nets = []
        for net, ends in self.ends(library).items():
            driven = [(name, pin, pin in library.cells[self.cells[name][0]].outputs) for name, pin in ends]
            pins = [f"*I {name}:{pin} {'O' if drives else 'I'}" for name, pin, drives in driven]
            before = [f"*P {net} I"] if net in self.inputs else []
            behind = [f"*P {net} O"] if net in self.outputs else []
            nets.append((net, self.wires_pf.get(net, 0.0), before + pins + behind))
        return programs.spef(nets)

    def files(self, library: Library) -> dict[str, str | bytes]:
        """Return library, netlist and wires for OpenSTA, by file name."""
        return {"cells.lib": library.content, "netlist.v": self.verilog(), "wires.spef": self.spef(library)}

    def unstored(self, library: Library) -> list[tuple[str, str]]:
        """Return the pairs of input and output that a path without a flop connects."""
        drivers = {wire: (kind, pins) for kind, pins in self.cells.values() for pin, wire in pins.items()
                   if pin in library.cells[kind].outputs and not library.cells[kind].flop}  # fmt: skip
        found = []
        for output in self.outputs:
            seen, todo = {output}, [output]
            while todo:
                kind, pins = drivers.get(todo.pop(), ("", {}))
                new = {pins[pin] for pin in library.cells[kind].inputs} - seen if kind else set()
                seen |= new
                todo += new
            found += [(name, output) for name in self.inputs if name in seen]
        return found


def wires_pf(routing: str) -> dict[str, float]:
    """Return the wire capacitance of each net in a DEF file, without vias."""
    found: dict[str, float] = {}
    net = ""
    for line in routing[routing.index("\nSPECIALNETS") :].splitlines():
        if begin := re.match(r" +- (\S+) \(", line):
            net = begin[1]
        if begun := re.search(r"(?:ROUTED|NEW) (\w+)", line):
            layer = begun[1]
            last = None
        for x, y in re.findall(r"\( (-?\d+|\*) (-?\d+|\*) \)", line) if "(" in line and not begin else ():
            here = [last[i] if word == "*" and last else int(word) for i, word in enumerate((x, y))]
            if last and layer in WIRES:
                width, area, edge = WIRES[layer]
                length = (abs(here[0] - last[0]) + abs(here[1] - last[1])) / 1000
                found[net] = found.get(net, 0.0) + length * (width * area + 2 * edge)
            last = here
    return found


Times = dict[tuple[str, float, float, str], tuple[float, ...]]
"""Rise and fall times that an OpenSTA script reports, by kind, two numbers and port."""


def _ask(top: str, script: Sequence[str], files: Mapping[str, str | bytes], folder: Path) -> Times:
    """Return the times that a script reports about a design, from its library, its Verilog and perhaps its wires."""
    library, netlist, *wires = files
    head = [
        "set sta_report_default_digits 6",
        f"read_liberty {library}",
        f"read_verilog {netlist}",
        f"link_design {top}",
    ]
    head += [f"read_spef {name}" for name in wires]
    said = programs.opensta("\n".join([*head, *script]), files, folder)
    (folder / "opensta.log").write_text(said.text)
    found = {}
    for heading, text in said.values.items():
        kind, first, second, port = heading.split()
        if times := TIMES.search(text):
            found[kind, float(first), float(second), port] = tuple(float(word) for word in times.groups())
    if not found or re.search(WRONG, said.text):
        raise RuntimeError(f"OpenSTA failed: {said.failed(WRONG)}")
    return found


def _clocked(block: Block) -> str:
    return programs.filled(
        "clocked.tcl", period=PERIOD_NS, inputs=" ".join(block.data), outputs=" ".join(block.outputs)
    )


def liberty(block: Block, library: Library, folder: Path) -> tuple[str, float]:
    """Return the timing model of a block as Liberty text, and its shortest clock period in ns between its own flops."""
    if paths := block.unstored(library):
        raise NoModel(f"a path without a flop leads from {paths[0][0]} to {paths[0][1]}; the model has no such arc")
    script = [_clocked(block), f"set_input_transition {SLEWS_NS[0]} [get_ports clk]"]
    script.append('puts "own 0 0 clk <<r [expr min([worst_slack -max], $period)]:0 f 0:0>>"')
    script += [f"leave {slew} {load}" for slew in SLEWS_NS for load in LOADS_PF]
    script.append("set_input_delay -clock clk 0 [get_ports $inputs]")
    script += [f"enter {clock} {data}" for clock in SLEWS_NS for data in SLEWS_NS]
    found = _ask(block.name, script, block.files(library), folder)

    def times(kind: str, name: str, column: int, seconds: Sequence[float]) -> NDArray[np.float64]:
        return np.array([[found[kind, first, second, name][column] for second in seconds] for first in SLEWS_NS])

    def limits(name: str) -> dict[str, dict[str, NDArray[np.float64]]]:
        """Return setup and hold times of an input, from its slacks."""
        slacks = [times("slack", name, column, SLEWS_NS) for column in range(4)]
        return {
            "setup": {"rise": PERIOD_NS - slacks[1], "fall": PERIOD_NS - slacks[3]},
            "hold": {"rise": 0.0 - slacks[0], "fall": 0.0 - slacks[2]},
        }

    ends, inputs = block.ends(library), []
    for name in block.inputs:
        pins = sum(library.cells[block.cells[cell][0]].loads[pin] for cell, pin in ends.get(name, []))
        capacitance_pf = 1e12 * pins + block.wires_pf.get(name, 0.0)
        inputs.append((name, capacitance_pf, limits(name) if name in ends and name != "clk" else {}))
    tables = (("cell_rise", "arrival", 1), ("cell_fall", "arrival", 3), ("rise_transition", "slew", 1),
              ("fall_transition", "slew", 3))  # fmt: skip
    text = programs.filled(
        "macro.lib",
        name=block.name,
        area_um2=block.width_um * block.height_um,
        leakage_nw=1e9 * sum(library.cells[kind].leakage_w for kind, _ in block.cells.values()),
        inputs=inputs,
        outputs={out: {what: times(kind, out, at, LOADS_PF) for what, kind, at in tables} for out in block.outputs},
        grid=GRID,
    )
    return text, PERIOD_NS - found["own", 0.0, 0.0, "clk"][0]


def check(text: str, block: Block, library: Library, folder: Path) -> float:
    """Return the largest difference in ns between the times of a model and of the netlist, both from OpenSTA.

    The model is an instance in another netlist. Slews and loads lie between those of the tables.
    """
    ports = ", ".join(f".{name}({name})" for name in block.inputs + block.outputs)
    ways = [f"input {name}" for name in block.inputs] + [f"output {name}" for name in block.outputs]
    outer = f"module outer({', '.join(ways)});\n  {block.name} inner ({ports});\nendmodule\n"
    slew, load = np.mean(SLEWS_NS[1:]), LOADS_PF[1]
    asked = [_clocked(block), f"leave {slew} {load}", "set_input_delay -clock clk 0 [get_ports $inputs]"]
    asked.append(f"enter {slew} {slew}")
    flat = _ask(block.name, asked, block.files(library), folder)
    model = _ask("outer", asked, {"macro.lib": text, "outer.v": outer}, folder)
    if missing := sorted(set(flat) ^ set(model)):
        raise RuntimeError(f"the model and the netlist differ in the times of {missing[0][3]}")
    apart = {key: np.abs(np.subtract(model[key], times)) for key, times in flat.items()}
    longest = [gaps[1::2] if key[0] == "arrival" else gaps for key, gaps in apart.items()]  # the model has no others
    return float(np.max(np.concatenate(longest)))
