"""Many mutants of one module in one simulation program: each an instance whose inputs are 0 until its turn comes."""

from __future__ import annotations

import re
from collections.abc import Mapping

from flow.mutants.equivalence import ports_of
from rtl import yosys
from rtl.verilog import YOSYS_SCRIPT

SCRIPT = (
    YOSYS_SCRIPT.replace("hierarchy -check -top {top}; ", "")
    .replace("eskin_classifier", "eskin_classifier__*")
    .replace("check -assert", "tee -q -o said.txt check")
)
"""As for the delivered Verilog; what it would have refused is told, and not fatal for all."""

REFUSED = re.compile(r"^Warning:.*\beskin_\w+?__(\d+)\b", re.MULTILINE)
CELL = re.compile(r"^  cell \\(eskin_\w+) ", re.MULTILINE)


def within(module: str, modules: Mapping[str, str]) -> dict[str, str]:
    """Return the RTLIL of a module and of those within it, by their names."""
    found: dict[str, str] = {}
    todo = [module]
    while todo:
        name = todo.pop()
        if name not in found:
            found[name] = modules[name]
            todo += CELL.findall(modules[name])
    return found


def _own(module: str, modules: Mapping[str, str], original: Mapping[str, str]) -> set[str]:
    """Return the modules that are not those of the original, or have one within that is not."""
    found: set[str] = set()
    for name in (module, *CELL.findall(modules[module])):
        if name != module and name not in found:
            found |= _own(name, modules, original)
    if found or modules[module] != original.get(module):
        found.add(module)
    return found


def numbered(modules: Mapping[str, str], number: int, own: set[str]) -> str:
    """Return the RTLIL of a design's own modules, whose names carry its number; the others are those of design 0."""
    text = "\n".join(modules[name] for name in modules if name in own)

    def named(found: re.Match[str]) -> str:
        return f"{found[1]} \\{found[2]}__{number if found[2] in own else 0}"

    text = re.sub(r"^(module|  cell) \\(eskin_\w+)", named, text, flags=re.MULTILINE)
    return re.sub(r"^attribute \\top 1\n", "", text, flags=re.MULTILINE)


def verilog(module: str, designs: Mapping[int, Mapping[str, str]]) -> tuple[str, set[int]]:
    """Return Verilog of a module with a register ``mutant`` that says which design it is, and the numbers refused.

    Parameters
    ----------
    module : str
    designs : mapping of int to mapping of str to str
        RTLIL of the module and those within, by name, of every design by its number; 0 is the original.
    """
    own = {number: _own(module, modules, designs[0]) if number else set(modules) for number, modules in designs.items()}
    text = "\n".join(numbered(modules, number, own[number]) for number, modules in designs.items())
    made = yosys.run_for(SCRIPT, text, ("readout.v", "said.txt"))
    refused = {int(number) for number in REFUSED.findall(made["said.txt"])}
    if 0 in refused:
        raise ValueError(f"the original of {module} is refused: {made['said.txt'][:500]}")
    left = [number for number in designs if number not in refused]
    return made["readout.v"] + _chosen(module, ports_of(designs[0][module]), left), refused


def _chosen(module: str, ports: list[tuple[int, str, str]], numbers: list[int]) -> str:
    """Return the module around all designs."""
    lines = [f"module {module}({', '.join(name for _, _, name in ports)});", "  reg [15:0] mutant = 0;"]
    for bits, way, name in ports:
        kind = "input wire" if way == "input" else "output reg"
        lines.append(f"  {kind} [{bits - 1}:0] {name};")
    outputs = [(bits, name) for bits, way, name in ports if way == "output"]
    for number in numbers:
        lines.append(f"  wire is_{number} = mutant == {number};")
        lines += [f"  wire [{bits - 1}:0] {name}_{number};" for bits, name in outputs]
        wired = [
            f".{name}({name}_{number})" if way == "output" else f".{name}({name} & {{{bits}{{is_{number}}}}})"
            for bits, way, name in ports
        ]
        lines.append(f"  {module}__{number} design_{number}({', '.join(wired)});")
    lines += ["  always @* case (mutant)"]
    for number in numbers:
        taken = " ".join(f"{name} = {name}_{number};" for _, name in outputs)
        lines.append(f"    {number or 'default'}: begin {taken} end")
    return "\n".join([*lines, "  endcase", "endmodule", ""])
