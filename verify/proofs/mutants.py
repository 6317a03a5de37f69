"""Generate mutants of a block with Yosys' ``mutate``, each in one pin of one cell.

A mutant inverts a bit of a pin, ties it to a constant, or makes it depend on another bit of the same pin. The checker
and the bench stay as they are.
"""

import re
from dataclasses import dataclass
from typing import Any

from eskin.rtl import yosys
from eskin.verify.proofs.bench import cutting, rtlil_of
from eskin.verify.proofs.checker import Checker

PREPARE = "read_rtlil readout.il; hierarchy -check -top {top}; proc; opt_clean; "
"""Registers and multiplexers become cells, whose pins can be mutated."""

WIRES = "bufnorm -pos; bufnorm -reset; "
"""Wires and ports that are other names of a register or of a part of it get a cell too, so that they can be mutated."""

LIST = "mutate -list {count} -seed {seed} -o mutants.txt {only}; "
CLOCK_PIN = re.compile(r"-port \\?clk ", re.IGNORECASE)
"""Clock pins, which are not mutated: the solvers step all registers together, whatever their clock pins are tied to."""


@dataclass(frozen=True)
class Mutant:
    """One mutant of a block."""

    name: str  # arguments with which Yosys' ``mutate`` makes it from the block
    rtlil: str  # the block with the mutant, and the blocks within it


def mutants(checker: Checker[Any], count: int, seed: int, only: str = "") -> list[Mutant]:
    """Return mutants of the block that a checker observes; modules that its proof cuts out are not mutated.

    Seed 0 gives mutants of cells that compute or store, other seeds also those of mere wires. Mutants of clock pins are
    left out. ``only`` are arguments of ``mutate -list``, as in "-mode const0 -wire aer_req".
    """
    block = checker.block(checker.config)
    return make(rtlil_of(block), block.module_name, count, seed, only, cutting(checker))


def make(rtlil: str, top: str, count: int, seed: int, only: str = "", cut: str = "") -> list[Mutant]:
    """Return mutants of a design, without mutants of the cells that the commands in ``cut`` delete."""
    prepare = PREPARE.format(top=top) + WIRES * bool(seed)
    drawing = cut + LIST.format(count=count, seed=seed, only=only)
    listed = yosys.run(prepare + drawing, rtlil, "mutants.txt").splitlines()
    lines = [line for line in dict.fromkeys(listed) if not CLOCK_PIN.search(line)]
    files = [f"{number}.il" for number in range(len(lines))]
    script = prepare + "design -save whole; "
    for file, line in zip(files, lines, strict=True):
        script += f"design -load whole; {line}; write_rtlil {file}; "
    made = yosys.run_for(script, rtlil, files)
    return [Mutant(line.removeprefix("mutate "), made[file]) for file, line in zip(files, lines, strict=True)]
