"""Prove two flat designs with corresponding registers equal, function by function, with ABC."""

import json
import re
from dataclasses import dataclass
from typing import Any

from eskin.flow.asic.synthesis import FLOP_NAME
from eskin.flow.programs import filled
from eskin.rtl import yosys
from eskin.rtl.gates.cells import cell_of, highest_net

FLOP = re.compile(r"\$_DFF_P([PN]?)([01]?)_")
"""Flops with a rising clock edge, with level and value of their asynchronous reset, if any."""

MITER = (
    "read_json both.json; read_verilog miter.v; hierarchy -top miter; flatten; aigmap; "
    "write_aiger miter.aig; design -reset; "
)
SOLVE = ("read_aiger miter.aig", "strash", "ifraig", "fraig -C 1000000", "write_aiger done.aig")


@dataclass
class Register:
    """A flop cut from a design: nets of its value, its next value and its asynchronous resets."""

    held: int
    next: int | str
    clear: int | str
    preset: int | str
    inverted: bool = False


def compare(gold: dict[str, Any], gate: dict[str, Any]) -> tuple[int, list[str]]:
    """Return how many compare points of two designs are proved equal, and the names of all other compare points.

    A compare point is a flop (next value and resets) or a bit of an output port. ``gold`` and ``gate`` are modules of
    simple Yosys cells, as ``write_json`` writes them.
    """
    ours, theirs = _cut(gold), _cut(gate)
    pairs, lonely = _match(ours, gold, theirs, gate)
    inputs, outputs = (
        {name: len(port["bits"]) for name, port in gold["ports"].items() if port["direction"] == way}
        for way in ("input", "output")
    )
    named = _names(gold)  # of the designs as they were given
    _open(gold, [ours[name] for name, _ in pairs])
    _open(gate, [theirs[name] for _, name in pairs])
    held, following = ({"cut_held": len(pairs)}, {"cut_next": 3 * len(pairs)}) if pairs else ({}, {})
    miter = filled("miter.v", inputs=inputs | held, outputs=following | outputs)
    files = {
        "both.json": json.dumps({"modules": {"gold": gold, "gate": gate}}).encode(),
        "miter.v": miter.encode(),
    }
    head, *proved = yosys.run_abc(MITER, "", SOLVE, "done.aig", files).split("\n")
    equal = [line == "0" for line in proved[: int(head.split()[4])]]  # a bit of `differ` that is the constant 0
    names = [min(named.get(ours[flop].held, {flop})) for flop, _ in pairs]
    for port, width in outputs.items():
        names += [port] if width == 1 else [f"{port}[{bit}]" for bit in range(width)]
    points = [all(equal[3 * i : 3 * i + 3]) for i in range(len(pairs))] + equal[3 * len(pairs) :]
    differ = [name for name, same in zip(names, points, strict=True) if not same]
    return sum(points), differ + lonely


def _cut(module: dict[str, Any]) -> dict[str, Register]:
    """Remove the flops from a module; return their pin connections by name."""
    cut = {}
    for name, cell in list(module["cells"].items()):
        if not (found := FLOP.fullmatch(cell["type"])):
            continue
        pins = {pin: bits[0] for pin, bits in cell["connections"].items()}
        reset: int | str = pins.get("R", "0")
        if found[1] == "N":
            reset = add(module, "$_NOT_", A=reset)
        of = {value: reset if found[2] == value else "0" for value in "01"}
        cut[name] = Register(pins["Q"], pins["D"], of["0"], of["1"])
        del module["cells"][name]
    return cut


def add(module: dict[str, Any], kind: str, output: str = "Y", /, **inputs: int | str) -> int:
    """Add a logic gate or a library cell to a module and return its output net."""
    module["last"] = 1 + (module.get("last") or highest_net(module))
    module["cells"][f"$cut{module['last']}"] = cell_of(kind, inputs | {output: module["last"]}, output)
    return module["last"]


def _names(module: dict[str, Any]) -> dict[int, set[str]]:
    """Return the public names of every net, with bit numbers."""
    found: dict[int, set[str]] = {}
    for name, net in module["netnames"].items():
        if net["hide_name"]:
            continue
        first = net.get("offset", 0)
        for place, bit in enumerate(net["bits"]):
            known = name if len(net["bits"]) == 1 else f"{name}[{first + place}]"
            if isinstance(bit, int):
                found.setdefault(bit, set()).add(known)
    return found


def _match(
    ours: dict[str, Register], gold: dict[str, Any], theirs: dict[str, Register], gate: dict[str, Any]
) -> tuple[list[tuple[str, str]], list[str]]:
    """Return the pairs of flops with a common name, and the names of unmatched flops.

    A flop of the netlist bears the name of what it holds; one that is cleared where that is set holds the inverse.
    """
    known, meant = _names(gold), _names(gate)
    by_name = {name: flop for flop, register in ours.items() for name in known.get(register.held, ())}
    pairs, taken = [], set()
    lonely = []
    for flop, register in theirs.items():
        names = [flop.removeprefix("$flatten\\").partition(FLOP_NAME)[0], *sorted(meant.get(register.held, ()))]
        partner = next((by_name[name] for name in names if name in by_name and by_name[name] not in taken), None)
        if partner is None:
            lonely.append(names[-1])
            continue
        taken.add(partner)
        pairs.append((partner, flop))
        register.inverted = "0" not in (ours[partner].preset, register.clear) and register.preset == "0"
    lonely += [min(known.get(ours[flop].held, {flop})) for flop in ours if flop not in taken]
    return pairs, lonely


def _open(module: dict[str, Any], registers: list[Register]) -> None:
    """Add ports for values, next values and resets of a module's flops, in the order of a list."""
    held, following = [], []
    for register in registers:
        following += [register.next, register.clear, register.preset]
        if register.inverted:
            following[-3:] = [add(module, "$_NOT_", A=register.next), register.preset, register.clear]
            last = add(module, "$_NOT_", A="0")
            module["cells"][f"$cut{last}"]["connections"] = {"A": [last], "Y": [register.held]}
            held.append(last)
        else:
            held.append(register.held)
    module.pop("last", None)
    if registers:
        module["ports"]["cut_held"] = {"direction": "input", "bits": held}
        module["ports"]["cut_next"] = {"direction": "output", "bits": following}
        for name, bits in (("cut_held", held), ("cut_next", following)):
            module["netnames"][name] = {"hide_name": 0, "bits": bits, "attributes": {}}
