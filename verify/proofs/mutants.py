"""Generate mutants of a block with Yosys' ``mutate``, each in one pin of one cell.

A mutant inverts a bit of a pin, ties it to a constant, or makes it depend on another bit of the same pin. The checker
and the bench stay as they are.
"""

import re
from dataclasses import dataclass
from typing import Any

from eskin.rtl import yosys
from eskin.verify.proofs.bench import TOP, cutting, rtlil_of
from eskin.verify.proofs.checker import Checker
from eskin.verify.proofs.engine import MAP, WRITE

PREPARE = "read_rtlil readout.il; hierarchy -check -top {top}; proc; opt_clean; "
"""Registers and multiplexers become cells, whose pins can be mutated."""

WIRES = "bufnorm -pos; bufnorm -reset; "
"""Wires and ports that are other names of a register or of a part of it get a cell too, so that they can be mutated."""

LIST = "mutate -list {count} -seed {seed} -o mutants.txt {only}{others}; "
CLOCK_PIN = re.compile(r"-port \\?clk ", re.IGNORECASE)
"""Clock pins, which are not mutated: the solvers step all registers together, whatever their clock pins are tied to."""

ALONE = "read_rtlil {file}; hierarchy -check -top {top}; proc; {cut}flatten; opt_clean; rename {top} {name}; "
TOGETHER = (
    "design -copy-from gold gold; design -copy-from gate gate; "
    f"miter -equiv -flatten gold gate {TOP}; hierarchy -top {TOP}; {MAP}{WRITE}miter.aig; design -reset; "
)
EQUIVALENT = ("Networks are equivalent", "UNSATISFIABLE")
"""Messages of ABC on miters with and without registers."""


@dataclass(frozen=True)
class Mutant:
    """One mutant of a block."""

    name: str  # arguments with which Yosys' ``mutate`` makes it from the block
    rtlil: str  # the block with the mutant, and the blocks within it


def mutants(checker: Checker[Any], count: int, seed: int, only: str = "") -> list[Mutant]:
    """Return mutants of the block that a checker observes, without modules that its proof cuts out, and their pins.

    Seed 0 gives mutants of cells that compute or store, other seeds also those of mere wires. Mutants of clock pins are
    left out. ``only`` are arguments of ``mutate -list``, as in "-mode const0 -wire aer_req".
    """
    block = checker.block(checker.config)
    others = " *" * bool(checker.cut) + "".join(f" t:{module} %d" for module in checker.cut)
    return make(rtlil_of(block), block.module_name, count, seed, only, cutting(checker), others)


def make(rtlil: str, top: str, count: int, seed: int, only: str = "", cut: str = "", others: str = "") -> list[Mutant]:
    """Return mutants of a design, without cells that the commands in ``cut`` delete; ``others`` selects cells."""
    prepare = PREPARE.format(top=top) + WIRES * bool(seed)
    drawing = cut + LIST.format(count=count, seed=seed, only=only, others=others)
    listed = yosys.run(prepare + drawing, rtlil, "mutants.txt").splitlines()
    lines = [line for line in dict.fromkeys(listed) if not CLOCK_PIN.search(line)]
    files = [f"{number}.il" for number in range(len(lines))]
    script = prepare + "design -save whole; "
    for file, line in zip(files, lines, strict=True):
        script += f"design -load whole; {line}; write_rtlil {file}; "
    made = yosys.run_for(script, rtlil, files)
    return [Mutant(line.removeprefix("mutate "), made[file]) for file, line in zip(files, lines, strict=True)]


def is_equivalent(checker: Checker[Any], mutant: Mutant) -> bool:
    """Return True if a mutant is proved to have the outputs of the block for any inputs, in every clock.

    Modules that the checker's proof cuts out get the same inputs, and give the same outputs to both.
    """
    block = checker.block(checker.config)
    top = block.module_name
    cut = f"cd {top}; expose -evert {' '.join(f't:{module}' for module in checker.cut)}; cd ..; " if checker.cut else ""
    script = "".join(
        ALONE.format(file=file, top=top, cut=cut, name=name) + f"design -stash {name}; "
        for file, name in (("readout.il", "gold"), ("mutant.il", "gate"))
    )
    commands = ["read_aiger miter.aig", "strash", "dprove -r"]  # -r: no retiming, see ``EACH``
    said = yosys.run_abc(script + TOGETHER, rtlil_of(block), commands, files={"mutant.il": mutant.rtlil.encode()})
    return any(message in said for message in EQUIVALENT)
