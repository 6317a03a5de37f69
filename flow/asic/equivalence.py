"""Prove that a clock-gated netlist is equivalent to the RTL for every flop and every output."""

import json
from dataclasses import dataclass
from typing import Any

from eskin.base.errors import InputError
from eskin.flow.asic.clocks import ClockError, Clocks
from eskin.flow.asic.compare import add, compare
from eskin.flow.asic.synthesis import Netlist
from eskin.rtl import yosys
from eskin.rtl.gates.cells import Bit
from eskin.rtl.gates.clock_gates import TEST
from eskin.rtl.verilog import rtlil

READ = (
    "read_liberty -lib -ignore_miss_func cells.lib; read_verilog netlist.v; hierarchy -check -top {top}; "
    "flatten; opt_clean; delete t:$scopeinfo; write_json flat.json"
)
GOLD = (
    "read_rtlil readout.il; hierarchy -check -top {top}; proc; flatten; setattr -unset init w:*; "
    "delete t:$scopeinfo; techmap; dffunmap; simplemap; opt_clean; rename {top} gold; write_json gold.json; delete; "
)
GATE = (
    "read_liberty -ignore_miss_func cells.lib; read_json plain.json; hierarchy -top {top}; flatten; "
    "delete t:$scopeinfo; simplemap; opt_clean; rename {top} gate; delete gate %n; write_json gate.json; delete; "
)


@dataclass(frozen=True)
class Equivalence:
    """Result of the equivalence proof."""

    # proved, of: compare points (flops and bits of outputs) that are proved equal, and all compare points
    proved: int
    of: int
    unproved: tuple[str, ...]  # names of the other compare points
    # flops, gated_flops: flops of the netlist, and flops behind a clock gate
    flops: int
    gated_flops: int

    @property
    def holds(self) -> bool:
        """True if all points are proved, and there are more points than flops."""
        return self.proved == self.of > self.flops

    def to_dict(self) -> dict[str, int]:
        """Return the result as an entry of the report."""
        return {"proved": self.proved, "of": self.of}


def design_of(netlist: Netlist) -> dict[str, Any]:
    """Return a netlist as a flat design in the JSON format of Yosys."""
    return flat_design(netlist.text, netlist.top, netlist.library.content)


def flat_design(text: str, top: str, liberty: bytes) -> dict[str, Any]:
    """Return a Verilog netlist, with or without hierarchy, as a flat design in the JSON format of Yosys."""
    files = {"cells.lib": liberty, "netlist.v": text.encode()}
    try:
        return json.loads(yosys.run(READ.format(top=top), "", "flat.json", files))
    except yosys.YosysError as error:
        raise InputError(
            f"the netlist does not fit the cell library: {error.reason}; give netlist and library of one run"
        ) from None


def prove(netlist: Netlist, design: dict[str, Any] | None = None) -> Equivalence:
    """Return the result of proving a netlist equivalent to its RTL.

    A clock gate lets the rising edge through if its enable was high before. So a flop behind a gate is a flop with that
    enable. The proof first checks that only such gates stop clocks, then assumes a low test enable. Flops of both
    sides are matched by the name of their output. Then the next value of each flop, its resets and every output must be
    the same function of all flops and inputs. The proof assumes nothing about reachable states. Raises ClockError if
    anything but a clock gate stops a clock.
    """
    plain, flops, gated = with_enables(design or design_of(netlist), netlist)
    files = {"cells.lib": netlist.library.content, "plain.json": json.dumps(plain).encode()}
    script = GOLD.format(top=netlist.top) + GATE.format(top=netlist.top)
    made = yosys.run_for(script, rtlil(netlist.config), ("gold.json", "gate.json"), files)
    gold, gate = (json.loads(made[f"{side}.json"])["modules"][side] for side in ("gold", "gate"))
    proved, unproved = compare(gold, gate)
    return Equivalence(proved, proved + len(unproved), tuple(unproved), flops, gated)


def with_enables(design: dict[str, Any], netlist: Netlist, test: str = "0") -> tuple[dict[str, Any], int, int]:
    """Return a copy of a netlist with all flops on one clock and with enables instead of clock gates.

    The integers are the numbers of flops and of flops behind a clock gate.
    """
    module = json.loads(json.dumps(design["modules"][netlist.top]))
    tested = module["ports"].pop(TEST, {"bits": []})["bits"]
    module["netnames"].pop(TEST, None)
    for cell in module["cells"].values():
        cell["connections"] = {
            pin: [test if bit in tested else bit for bit in bits] for pin, bits in cell["connections"].items()
        }
    clocks = Clocks(module, netlist.library)
    high = _High(module, clocks)
    flops = gated = 0
    stopping = [name for name, _, _ in (*clocks.having("gate"), *clocks.having("latch"))]
    for name, cell, pins in list(clocks.having("flop")):
        flop = cell.flop
        assert flop
        clock = pins[flop.clock][0]
        clocks.check(name, clock)
        if not flop.rising or flop.data not in cell.inputs:
            raise ClockError(f"{name} is a {cell.name}, which is no flop of a rising edge with one data input")
        flops += 1
        if clock == clocks.root:
            continue
        gated += 1
        output = next(pin for pin in sorted(flop.outputs, key=lambda pin: flop.outputs[pin]) if pins.get(pin))
        held = pins[output][0]
        if flop.outputs[output]:
            held = add(module, "$_NOT_", A=held)
        pins[flop.data] = [add(module, "$_MUX_", A=held, B=pins[flop.data][0], S=high.of(clock))]
        pins[flop.clock] = [clocks.root]
    for name in stopping:
        del module["cells"][name]
    return {"modules": {netlist.top: module}}, flops, gated


class _High:
    """Logic added to a module that computes the clock network just before a rising edge."""

    def __init__(self, module: dict[str, Any], clocks: Clocks) -> None:
        self.module, self.clocks = module, clocks
        self.made: dict[Bit, Bit] = {clocks.root: "1"}

    def of(self, bit: Bit) -> Bit:
        """Return a data net with the value of a clock net while the clock is high."""
        if isinstance(bit, str) or not self.clocks.sources(bit):
            return bit
        if bit not in self.made:
            self.made[bit] = self._driven(bit)
        return self.made[bit]

    def _driven(self, bit: Bit) -> Bit:
        name, output = self.clocks.driver[bit]
        cell, pins = self.clocks.cell(name)
        if cell.gate:
            enable = pins[cell.gate.enable][0]
            if cell.gate.test and pins[cell.gate.test] != ["0"]:
                enable = add(self.module, "$_OR_", A=enable, B=pins[cell.gate.test][0])
            return add(self.module, "$_AND_", A=self.of(pins[cell.gate.clock][0]), B=enable)
        if cell.latch:
            stored = pins[cell.latch.data][0]
            return add(self.module, "$_NOT_", A=stored) if cell.latch.outputs[output] else stored
        return add(self.module, cell.name, output, **{pin: self.of(pins[pin][0]) for pin in cell.inputs})
