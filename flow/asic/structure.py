"""Structural checks of a netlist: one clock, latches only in clock gates, reset for every flop, loads of outputs."""

import math
from dataclasses import dataclass
from typing import Any

from eskin.flow.asic.clocks import Clocks, levels, value
from eskin.flow.asic.equivalence import with_enables
from eskin.flow.asic.synthesis import Netlist
from eskin.flow.liberty.boolean import possible
from eskin.flow.liberty.library import Library
from eskin.rtl.gates.cells import Bit

NO_CHAIN = (
    "not inserted: the order of a scan chain follows from the placement, so a layout tool makes it; the netlist is "
    "ready for it, since with test_enable high every clock runs and a reset pin is never stuck"
)

RESET_CLOCKS = 4
"""Clocks of reset after which every flop must have a known value; a gate may need a state that the reset sets first."""


@dataclass(frozen=True)
class Overload:
    """An output that drives more pins than the library allows."""

    output: str  # cell and pin, ``tick_reg/Q``
    # load_f, allowed_f: capacitance of the pins, and ``max_capacitance`` of the library
    load_f: float
    allowed_f: float


@dataclass(frozen=True)
class Structure:
    """Violations found by the structural checks."""

    # clock_gates: with the gates that are built of a latch
    flops: int
    clock_gates: int
    # without_reset, stopped_in_test: flops unknown after ``RESET_CLOCKS`` clocks of reset, or stopped by test_enable
    without_reset: tuple[str, ...]
    stopped_in_test: tuple[str, ...]
    stray_latches: tuple[str, ...]  # latches outside of clock gates
    overloaded: tuple[Overload, ...] = ()  # largest load first; without clocks, which the layout buffers

    @property
    def warning(self) -> str:
        """One sentence about overloaded outputs; empty without any."""
        if not self.overloaded:
            return ""
        worst, more = self.overloaded[0], len(self.overloaded) - 1
        return (
            f"{worst.output} drives {worst.load_f * 1e12:.3g} pF, its library allows {worst.allowed_f * 1e12:.3g} pF"
            f"{f'; {more} more outputs drive too much' if more else ''}; buffer these nets in the layout"
        )

    @property
    def problems(self) -> list[str]:
        """One sentence for each violated rule."""
        said = []
        for names, what in (
            (self.without_reset, "has no reset"),
            (self.stopped_in_test, "has a clock that stands still with test_enable high"),
            (self.stray_latches, "is a latch outside of a clock gate"),
        ):
            if names:
                more = f", and {len(names) - 1} more" if len(names) > 1 else ""
                said.append(f"{names[0]} {what}{more}")
        return said

    def to_dict(self) -> dict[str, Any]:
        """Return the result as an entry of the report."""
        return {
            "clocks": 1,
            "clock_gates": self.clock_gates,
            "latches_outside_gates": len(self.stray_latches),
            "flops_without_reset": len(self.without_reset),
            "outputs_over_max_capacitance": len(self.overloaded),
            **({"largest_load": vars(self.overloaded[0])} if self.overloaded else {}),
            "scan": {"flops_clocked_in_test": self.flops - len(self.stopped_in_test), "chain": NO_CHAIN},
        }


def check(netlist: Netlist, design: dict[str, Any]) -> Structure:
    """Return the violations of the structural rules in a netlist."""
    clocks = Clocks(design["modules"][netlist.top], netlist.library)
    readers = _readers(clocks)
    latches = list(clocks.having("latch"))
    stray = [name for name, cell, pins in latches if not _gates(clocks, readers, cell, pins)]
    gates = sum(1 for _ in clocks.having("gate")) + len(latches) - len(stray)
    plain, flops, _ = with_enables(design, netlist)
    module = plain["modules"][netlist.top]
    without = _without_reset(module, netlist.library)
    tested, _, _ = with_enables(design, netlist, test="1")
    in_test = levels(tested["modules"][netlist.top], netlist.library, {})
    stopped = [
        name
        for name, cell in tested["modules"][netlist.top]["cells"].items()
        if cell["type"] == "$_MUX_" and in_test.get(cell["connections"]["S"][0], "x") != "1"
    ]
    over = _overloaded(clocks, readers)
    return Structure(flops, gates, tuple(without), tuple(stopped), tuple(stray), over)


def _overloaded(clocks: Clocks, readers: dict[Bit, list[tuple[str, str]]]) -> tuple[Overload, ...]:
    """Return the outputs whose pins have more capacitance than allowed, the largest load first."""
    found = []
    for name in clocks.module["cells"]:
        cell, pins = clocks.cell(name)
        for pin in cell.outputs:
            allowed = cell.pins[pin].entry.number("max_capacitance", math.inf) * clocks.library.scales.capacitance
            for bit in pins.get(pin, []):
                driven = [(clocks.cell(other)[0], to) for other, to in readers.get(bit, [])]
                load = sum(reader.pins[to].load_f for reader, to in driven)
                if load > allowed and not any(to in reader.clock_pins for reader, to in driven):
                    found.append(Overload(f"{name}/{pin}", load, allowed))
    return tuple(sorted(found, key=lambda over: -over.load_f))


def _readers(clocks: Clocks) -> dict[Bit, list[tuple[str, str]]]:
    """Return cell and pin of every input that each net drives."""
    found: dict[Bit, list[tuple[str, str]]] = {}
    for name in clocks.module["cells"]:
        cell, pins = clocks.cell(name)
        for pin in cell.inputs:
            for bit in pins.get(pin, []):
                found.setdefault(bit, []).append((name, pin))
    return found


def _gates(clocks: Clocks, readers: dict[Bit, list[tuple[str, str]]], cell: Any, pins: dict[str, list[Bit]]) -> bool:
    """Return True if a latch belongs to a clock gate."""
    if clocks.clock_of(cell, pins) is None:
        return False
    for output in cell.latch.outputs:
        for bit in pins.get(output, []):
            for name, _ in readers.get(bit, []):
                reader, connections = clocks.cell(name)
                results = [b for pin in reader.functions for b in connections.get(pin, [])]
                if reader.flop or reader.latch or any(clocks.level(b, False) == "x" for b in results):
                    return False
    return True


def _without_reset(module: dict[str, Any], library: Library) -> list[str]:
    """Return the flops with unknown values after ``RESET_CLOCKS`` clocks of reset, from unknown states and inputs."""
    known: dict[Bit, str] = dict.fromkeys(module["ports"]["rst"]["bits"], "1")
    waiting = {name for name, instance in module["cells"].items() if instance["type"] in library.flops}
    for _ in range(RESET_CLOCKS):
        found = levels(module, library, known)
        for name in sorted(waiting):
            instance = module["cells"][name]
            flop, pins = library.cells[instance["type"]].flop, instance["connections"]
            assert flop
            given = tuple((pin, value(bits[0], found)) for pin, bits in pins.items() if bits)
            held = value(pins[flop.data][0], found)
            for text, level in ((flop.preset, "1"), (flop.clear, "0")):
                held = level if text and possible(text, given) == "1" else held
            if held != "x":
                waiting.remove(name)
                for pin, inverted in flop.outputs.items():
                    known |= dict.fromkeys(pins.get(pin, []), str(int(held) ^ inverted))
    return sorted(waiting)
