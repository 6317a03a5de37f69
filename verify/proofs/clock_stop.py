"""Prove that the clock of a block may stop while ``awake`` is low, and that idle blocks stop their clocks.

Asked of every state and all inputs, reachable or not, so one clock is all there is to look at.
"""

import json
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from eskin.rtl import yosys
from eskin.rtl.block import Block
from eskin.verify.proofs.bench import rtlil_of

LISTENS = ("link", "host", "timer")
"""Names of parts without a clock gate, because they sample ACK or SPI, or count bins."""

AWAKE = "awake"

TO_FLOPS = (
    "read_rtlil readout.il; delete t:$meminit_v2; hierarchy -check -top {top}; proc; flatten; opt_clean; dffunmap; "
    "memory_collect; setattr -unset init w:*; write_json flops.json"
)
TO_ANSWER = (
    "read_json still.json; hierarchy -top {top}; "
    "tee -q -o said.txt sat -set rst 0 -set all_awake {awake} -prove next state -prove written 0"
)
UNSOLVED = re.compile(r"SAT proof finished - (no )?model found")

TO_ENABLES = (
    "read_rtlil readout.il; delete t:$meminit_v2; hierarchy -check -top {top}; proc; opt_expr; opt_merge; "
    "opt_clean; opt_dff; dffunmap -srst-only; opt_expr; opt_dff -nosdff; opt_clean; flatten; opt_clean; "
    "memory_collect; setattr -unset init w:*; write_json flops.json"
)
TO_CLOCKS = (
    "read_json still.json; read_verilog both.v; hierarchy -check -top both; proc; flatten; opt_clean; "
    "tee -q -o said.txt sat -set rst 0 -set rest 1 -show clocked -prove others 0; "
    "tee -q -a said.txt sat -set rst 0 -set rest 1 -set others 0 -set whole 1"
)
SHOWN = re.compile(r"^  \\clocked +\S+ +\S+ +([01]+)\s*$", re.MULTILINE)
PATH = re.compile(r"\\([^.\\]+)\.")


def stands_still(block: Block[Any], awake: int = 0, mutant: str = "") -> bool:
    """Return True if all registers and memories of a block are stable while ``awake`` is low, except in reset.

    The block has a signal ``awake``, or parts that have one: then all of these are low. With ``awake`` 1 the answer
    tells whether anything can change at all. ``mutant`` is RTLIL that takes the place of the block's own.
    """
    top = block.module_name
    module = _flat(block, TO_FLOPS, mutant)
    state, after = [], []
    written = _cut_memories(module)
    for name, cell in _flops(module, ("$dff",)):
        if not any(f"\\{part}." in name for part in LISTENS):
            state += cell["connections"]["Q"]
            after += cell["connections"]["D"]
    nets = module["netnames"]
    parts = [AWAKE] if AWAKE in nets else [name for name in nets if name.endswith(f".{AWAKE}") and name.count(".") == 1]
    all_awake = [nets[name]["bits"][0] for name in parts]
    outputs = {"next": after, "written": written or ["0"], "all_awake": all_awake}
    _add_ports(module, {"state": ("input", state)} | {name: ("output", bits) for name, bits in outputs.items()})
    files = {"still.json": json.dumps({"modules": {top: module}}).encode()}
    script = TO_ANSWER.format(top=top, awake=awake and (1 << len(all_awake)) - 1)
    if not state or not all_awake:
        raise AssertionError(f"nothing of {top} is compared, with {len(state)} registers")
    return _solved(top, script, files)[0]


@dataclass(frozen=True)
class Clocked:
    """Registers that receive a clock in an idle block."""

    # registers that are unexpectedly clocked, and signals ``awake`` that are unexpectedly high, in one case
    others: tuple[str, ...]
    reached: bool  # whether all expected ones can be so in a single case


def clocked(
    block: Block[Any],
    expected: Collection[str] = (),
    rest: Mapping[str, int] | None = None,
    then: Mapping[str, int] | None = None,
    held: Mapping[str, int] | None = None,
    mutant: str = "",
) -> Clocked:
    """Return the registers of an idle block that unexpectedly receive a clock.

    A block is at rest where no register of it would change. A register gets a clock where its enable is high, and so is
    ``awake`` of every block that it is in, as far as these have such a signal.

    ``expected`` are registers and signals ``awake``, those of inner blocks by their paths: ``row_0.taxel_1.newest``.
    The block is at rest with the inputs ``rest``; ``then`` are inputs that have other values in the clock that is
    looked at, and ``held`` registers that have one value. ``mutant`` is RTLIL that takes the place of the block's own.
    """
    before = dict(rest or {})
    module = _flat(block, TO_ENABLES, mutant)
    _cut_memories(module)
    inputs = {n: len(p["bits"]) for n, p in module["ports"].items() if p["direction"] == "input" and n != "clk"}
    nets = module["netnames"]
    awake = [name for name in nets if name.rpartition(".")[2] == AWAKE]
    flops = [(_name(nets, name, cell), cell) for name, cell in _flops(module, ("$dff", "$dffe"))]
    when: dict[str, list[str]] = {}
    for number, (name, cell) in enumerate(flops):
        if not int(cell["parameters"].get("EN_POLARITY", "1"), 2):
            raise AssertionError(f"{name} of {block.module_name} has an active-low enable, which is not supported")
        paths = [signal.removesuffix(AWAKE) for signal in awake]  # a signal stops the registers of its block
        gates = [
            f"cut_awake[{place}]"
            for place, path in enumerate(paths)
            if name.startswith(path) and (path or name.partition(".")[0] not in LISTENS)
        ]
        when.setdefault(name, []).append(" & ".join([f"cut_enable[{number}]", *gates]))
    when |= {signal: [f"cut_awake[{place}]"] for place, signal in enumerate(awake)}
    if missing := sorted(set(expected) - set(when)):
        raise AssertionError(f"{block.module_name} has no {', '.join(missing)}; it has {', '.join(when)}")
    of_awake = [nets[signal]["bits"][0] for signal in awake]
    pins = [cell["connections"] for _, cell in flops]
    state = [bit for pin in pins for bit in pin["Q"]]
    module["ports"].pop(AWAKE, None)
    _add_ports(
        module,
        {
            "cut_state": ("input", state),
            "cut_next": ("output", [bit for pin in pins for bit in pin["D"]]),
            "cut_enable": ("output", [pin.get("EN", ["1"])[0] for pin in pins]),
            "cut_awake": ("output", of_awake or ["0"]),
        },
    )
    shapes = [(len(cell["connections"]["Q"]), dict(held or {}).get(name)) for name, cell in flops]
    mask = "".join("01"[name in expected] for name in reversed(when))
    both = _both(block.module_name, inputs, [before, before | dict(then or {})], shapes, max(len(awake), 1))
    both += "".join(f"  assign clocked[{n}] = {' | '.join(terms)};\n" for n, terms in enumerate(when.values()))
    both += f"  assign others = |(clocked & ~{len(when)}'b{mask});\n"
    both += f"  assign whole = &(clocked | ~{len(when)}'b{mask});\nendmodule\n"
    files = {
        "still.json": json.dumps({"modules": {block.module_name: module}}).encode(),
        "both.v": both.replace("CLOCKED", str(len(when) - 1)).encode(),
    }
    alone, said = _solved(block.module_name, TO_CLOCKS, files)
    others = SHOWN.search(said)
    high = [name for name, bit in zip(when, reversed(others[1]), strict=True) if bit == "1"] if others else []
    if not alone and not high:
        raise AssertionError(f"the solver does not report the clocked registers of {block.module_name}")
    return Clocked(tuple(name for name in high if name not in expected), "SAT solving finished - model found" in said)


def _solved(top: str, script: str, files: Mapping[str, bytes]) -> tuple[bool, str]:
    """Return whether the solver proves what a script asks first, and all that it says."""
    said = yosys.run(script, "", "said.txt", files)
    if not (found := UNSOLVED.search(said)):
        raise AssertionError(f"the solver reports no result for {top}")
    return found[1] is not None, said


def _flat(block: Block[Any], script: str, mutant: str) -> Any:
    """Return a block as one flat module of simple Yosys cells and flops."""
    top = block.module_name
    return json.loads(yosys.run(script.format(top=top), mutant or rtlil_of(block), "flops.json"))["modules"][top]


def _flops(module: Any, kinds: tuple[str, ...]) -> list[tuple[str, Any]]:
    """Remove the flops from a module; return them by name."""
    found = [(name, cell) for name, cell in module["cells"].items() if cell["type"] in kinds]
    for name, _ in found:
        del module["cells"][name]
    for name, cell in module["cells"].items():
        if "dff" in cell["type"] or cell["type"].startswith("$mem"):
            raise AssertionError(f"{name} is a {cell['type']}, which is not supported")
    return found


def _cut_memories(module: Any) -> list[Any]:
    """Remove the memories from a module, so that a read gives any word; return the bits of their write enables."""
    memories = {name: cell for name, cell in module["cells"].items() if cell["type"] == "$mem_v2"}
    written: set[Any] = set()
    for number, (name, cell) in enumerate(memories.items()):
        del module["cells"][name]
        if "1" in cell["parameters"]["RD_CLK_ENABLE"]:
            raise AssertionError(f"{name} has a clocked read port, which is not supported")
        written |= set(cell["connections"]["WR_EN"])
        _add_ports(module, {f"content_{number}": ("input", cell["connections"]["RD_DATA"])})
    return sorted(written, key=str)


def _add_ports(module: Any, ports: Mapping[str, tuple[str, list[Any]]]) -> None:
    for name, (direction, bits) in ports.items():
        module["ports"][name] = {"direction": direction, "bits": bits}
        module["netnames"][name] = {"hide_name": 0, "bits": bits, "attributes": {}}


def _name(nets: Any, flop: str, cell: Any) -> str:
    """Return path and name of the register that contains a flop."""
    path = "".join(f"{part}." for part in PATH.findall(flop))
    held = cell["connections"]["Q"][0]
    known = [
        name for name, net in nets.items() if name.startswith(path) and held in net["bits"] and not net["hide_name"]
    ]
    return min((name for name in known if "." not in name[len(path) :]), key=len, default=flop)


def _both(
    top: str, inputs: Mapping[str, int], cases: list[dict[str, int]], flops: list[tuple[int, int | None]], awake: int
) -> str:
    """Return Verilog of two copies of a block with equal registers: idle, and in the checked clock.

    ``flops`` are the widths of the registers, with their values where these are given.
    """
    bits = sum(width for width, _ in flops)
    ports = [*(f"input [{width - 1}:0] {name}" for name, width in inputs.items()), f"input [{bits - 1}:0] cut_state"]
    ports += ["output rest", "output others", "output whole", "output [CLOCKED:0] clocked"]
    text = f"module both({', '.join(ports)});\n  wire [{bits - 1}:0] cut_next;\n"
    text += f"  wire [{len(flops) - 1}:0] had, cut_enable;\n  wire [{awake - 1}:0] cut_awake;\n"
    results = [".cut_next(cut_next), .cut_enable(had)", ".cut_enable(cut_enable), .cut_awake(cut_awake)"]
    for number, (given, result) in enumerate(zip(cases, results, strict=True)):
        fixed = {name: f"{inputs[name]}'d{value % (1 << inputs[name])}" for name, value in given.items()}
        wires = [f".{name}({fixed.get(name, name)})" for name in inputs]
        text += f"  {top} case_{number}({', '.join(wires)}, .cut_state(cut_state), {result});\n"
    low, still = 0, []
    for number, (width, value) in enumerate(flops):
        part = f"[{low + width - 1}:{low}]"
        still.append(f"(~had[{number}] | (cut_next{part} == cut_state{part}))")
        if value is not None:
            still.append(f"(cut_state{part} == {width}'d{value})")
        low += width
    return text + f"  assign rest = {' & '.join(still)};\n"
