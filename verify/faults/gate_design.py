"""A design as gates and flops in order of evaluation."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from graphlib import TopologicalSorter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.rtl import yosys

# Flattened last: then a flop's name says in which block it is.
TO_GATES = (
    "read_rtlil readout.il; hierarchy -check -top {top}; proc; opt_clean; memory_map; async2sync; opt -full; techmap; "
    "opt -fast; simplemap; dffunmap; simplemap; opt_clean; flatten -noscopeinfo; setattr -unset init w:*; opt_expr; "
    "opt_clean; write_json gates.json"
)
PATH = re.compile(r"\\(\w+)\.")
KINDS = {"$_AND_": 0, "$_OR_": 1, "$_XOR_": 2, "$_XNOR_": 3, "$_NOT_": 4, "$_MUX_": 5, "$_BUF_": 6}
PINS = "ABS"
ZERO, ONE = 0, 1
"""Numbers of the nets with the constants 0 and 1, which are the first two nets."""


@dataclass(frozen=True)
class Gates:
    """Gate-level design with one clock; nets are numbered constants, inputs, flops and gates."""

    # nets of the ports, lowest bit first
    inputs: dict[str, list[int]]
    outputs: dict[str, list[int]]
    flops: list[str]  # names, each with its place in the hierarchy: ``row_0.taxel_1.pending``, with ``[bit]`` in a word
    first_flop: int  # net of the first flop; they follow each other
    next: NDArray[np.int32]  # nets that the flops take at a rising edge, shape (flops,)
    gates: NDArray[np.int32]  # kind and inputs, shape (gates, 4); their outputs are the last nets, in this order

    @property
    def nets(self) -> int:
        """Number of nets."""
        return self.first_flop + len(self.flops) + len(self.gates)


def gates_of(rtlil: str, top: str) -> Gates:
    """Return the gate-level design for RTLIL."""
    module = json.loads(yosys.run(TO_GATES.format(top=top), rtlil, "gates.json"))["modules"][top]
    net_of: dict[Any, int] = {"0": ZERO, "1": ONE, "x": ZERO}
    ports = module["ports"]
    for port in ports.values():
        if port["direction"] == "input":
            for bit in port["bits"]:
                net_of[bit] = len(net_of) - 1  # "x" has no net of its own
    first_flop = len(net_of) - 1
    drivers: dict[int, tuple[int, list[Any]]] = {}
    after: list[Any] = []
    states: list[int] = []
    places: dict[int, str] = {}
    for name, cell in module["cells"].items():
        pins = {pin: bits[0] for pin, bits in cell["connections"].items()}
        if cell["type"] == "$_DFF_P_":
            states.append(pins["Q"])
            after.append(pins["D"])
            places[pins["Q"]] = "".join(f"{part}." for part in PATH.findall(name))
        elif cell["type"] in KINDS:
            drivers[pins["Y"]] = KINDS[cell["type"]], [pins[pin] for pin in PINS if pin in pins]
        else:
            raise AssertionError(f"cell {cell['type']} of {top} is not supported")
    names = _names(module, places)
    order = sorted(range(len(states)), key=lambda place: _natural(names[states[place]]))
    for place in order:
        net_of[states[place]] = len(net_of) - 1
    sorter = TopologicalSorter({out: [bit for bit in given if bit in drivers] for out, (_, given) in drivers.items()})
    rows = []
    for out in sorter.static_order():
        kind, given = drivers[out]
        rows.append([kind, *(net_of[bit] for bit in given), *[ZERO] * (3 - len(given))])
        net_of[out] = len(net_of) - 1
    directed: dict[str, dict[str, list[int]]] = {"input": {}, "output": {}}
    for name, port in ports.items():
        directed[port["direction"]][name] = [net_of[bit] for bit in port["bits"]]
    return Gates(
        inputs=directed["input"],
        outputs=directed["output"],
        flops=[names[states[place]] for place in order],
        first_flop=first_flop,
        next=np.array([net_of[after[place]] for place in order], np.int32),
        gates=np.array(rows, np.int32).reshape(-1, 4),
    )


def _names(module: dict[str, Any], places: dict[int, str]) -> dict[int, str]:
    """Return the name of every flop from its block and wire."""
    found: dict[int, tuple[int, str]] = {}
    for name, net in module["netnames"].items():
        for number, bit in enumerate(net["bits"]):
            place = places.get(bit)
            if place is not None and not net["hide_name"] and "$" not in name and name.startswith(place):
                said = f"{name}[{number}]" if len(net["bits"]) > 1 else name
                found[bit] = min(found.get(bit, (99, "")), (name.count("."), said))
    return {bit: found[bit][1] if bit in found else f"{place}flop {bit}" for bit, place in places.items()}


def _natural(name: str) -> tuple[Any, ...]:
    """Return a sort key that orders numbers in names by value."""
    parts = name.replace("[", ".[.").replace("]", "").replace("_", "._.").split(".")
    return tuple((part.isdigit(), int(part) if part.isdigit() else 0, part) for part in parts)
