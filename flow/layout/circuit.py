"""A readout as verified cells, proved equivalent to its RTL, for the layout tools (BLIF, SPICE)."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.flow.asic import synthesis
from eskin.flow.layout.cells import BUFFER
from eskin.flow.liberty.library import read
from eskin.model.config import ReadoutConfig
from eskin.rtl import yosys
from eskin.rtl.gates.clock_gates import TEST

READ = "read_liberty -lib -ignore_miss_func cells.lib; read_verilog netlist.v; hierarchy -check -top {top}; "

SUPPLY, GROUND = "vdd", "vss"

# No wire may have two names in the layout: an output that copies another output gets a buffer.
BUFFERED = (
    READ + "delete -port {top}/w:{test}; insbuf -buf {buffer} i q; opt_clean; rename -enumerate -pattern g% c:*; "
    "check -assert -mapped; write_verilog -noattr -noexpr buffered.v"
)
# One wire a bit.
SPLIT = READ + "splitnets -ports -format _; opt_clean -purge; check -assert -mapped; write_json bits.json"


@dataclass(frozen=True)
class SpiceCell:
    """A cell as a SPICE netlist of transistors."""

    ports: tuple[str, ...]  # in the order of the SPICE line, with supply and ground
    text: str


def read_spice(text: str) -> dict[str, SpiceCell]:
    """Return the ``.subckt`` blocks of a SPICE file by name."""
    blocks = re.finditer(r"^\.subckt (\S+) (.*?)\n.*?^\.ends.*?$", text, re.MULTILINE | re.DOTALL)
    return {found[1]: SpiceCell(tuple(found[2].split()), found[0]) for found in blocks}


@dataclass(frozen=True)
class Circuit:
    """A netlist of cells and single-bit wires."""

    top: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    # by instance: kind, and wire of each pin
    cells: dict[str, tuple[str, dict[str, str]]] = field(repr=False)

    @classmethod
    def from_dict(cls, said: Mapping[str, Any]) -> Circuit:
        """Return the circuit stored as JSON by ``dataclasses.asdict``."""
        cells = {name: (kind, pins) for name, (kind, pins) in said["cells"].items()}
        return cls(said["top"], tuple(said["inputs"]), tuple(said["outputs"]), cells)

    @property
    def ports(self) -> tuple[str, ...]:
        """Input ports, then output ports."""
        return self.inputs + self.outputs

    @property
    def wires(self) -> set[str]:
        """All wires driven or read by a cell."""
        return {wire for _, pins in self.cells.values() for wire in pins.values()}

    @property
    def read_ports(self) -> tuple[str, ...]:
        """Ports that a cell drives or reads."""
        wires = self.wires
        return tuple(port for port in self.ports if port in wires)

    @property
    def kinds(self) -> Counter[str]:
        """Number of instances of every cell."""
        return Counter(kind for kind, _ in self.cells.values())

    def blif(self) -> str:
        """Return the circuit in BLIF format."""
        lines = [f".model {self.top}", f".inputs {' '.join(self.inputs)}", f".outputs {' '.join(self.outputs)}"]
        for kind, pins in self.cells.values():
            lines.append(f".subckt {kind} " + " ".join(f"{pin}={wire}" for pin, wire in pins.items()))
        return "\n".join([*lines, ".end\n"])

    def spice(self, cells: Mapping[str, SpiceCell], name: str) -> str:
        """Return the SPICE netlist ``name`` down to transistors; supply and ground are its first ports."""
        lines = [f"* {name}", *(cells[kind].text for kind in sorted(self.kinds))]
        lines.append(f".subckt {name} {SUPPLY} {GROUND} {' '.join(self.ports)}")
        for instance, (kind, pins) in self.cells.items():
            wires = {SUPPLY: SUPPLY, GROUND: GROUND, **pins}
            lines.append(f"X{instance} {' '.join(wires[port] for port in cells[kind].ports)} {kind}")
        return "\n".join([*lines, f".ends {name}", ".end\n"])


def synthesise(config: ReadoutConfig, liberty: Path) -> synthesis.Netlist:
    """Return a readout synthesised to library cells, flat."""
    made = synthesis.synthesise(config, read(liberty))
    script = BUFFERED.format(top=made.top, test=TEST, buffer=BUFFER)
    files = {"cells.lib": liberty.read_bytes(), "netlist.v": made.text.encode()}
    text = yosys.run(script, "", "buffered.v", files)
    return replace(made, text=text[text.index("module ") :])


def circuit_of(made: synthesis.Netlist) -> Circuit:
    """Return a netlist as a circuit of cells and single-bit wires."""
    files = {"cells.lib": made.library.content, "netlist.v": made.text.encode()}
    return of_json(json.loads(yosys.run(SPLIT.format(top=made.top), "", "bits.json", files)), made.top)


def of_json(design: Mapping[str, Any], top: str) -> Circuit:
    """Return the circuit for a JSON netlist from Yosys."""
    module = design["modules"][top]
    ports = {name: port["direction"] for name, port in module["ports"].items()}
    names = {port["bits"][0]: name for name, port in module["ports"].items()}
    cells = {}
    constant = [f"output {name}" for name, port in module["ports"].items() if isinstance(port["bits"][0], str)]
    for name, cell in module["cells"].items():
        pins = {pin: bits[0] for pin, bits in cell["connections"].items()}
        constant += [f"pin {pin} of {name}" for pin, bit in pins.items() if isinstance(bit, str)]
        cells[name] = (cell["type"], {pin: names.get(bit, f"n{bit}") for pin, bit in pins.items()})
    if constant:
        raise InputError(
            f"{constant[0]} of this readout is constant, and no checked cell makes a constant; choose "
            f"another configuration, for example two rows and two columns"
        )
    inputs, outputs = (tuple(n for n, d in ports.items() if d == way) for way in ("input", "output"))
    return Circuit(top, inputs, outputs, cells)
