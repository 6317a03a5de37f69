"""Runs the proofs and sums up what they say."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from flow.formal.checker import Property
from flow.formal.engine import Verdict, solve
from flow.formal.mutants import Mutant, mutants, planted
from flow.formal.plan import Proof

FEWEST_MUTANTS = 3
"""Planted bugs that every property must notice."""


@dataclass
class Outcome:
    """What all proofs together say of one property of one block.

    Attributes
    ----------
    block : str
    property : Property
    sizes : list of str
        Configurations in which it was proved.
    problems : list of str
        Why it counts as failed; empty where it holds.
    seconds : float
        Of all proofs of its block: the solver takes the properties of a block together.
    depth : int
        Clocks of the deepest search for a failure.
    reached : int or None
        First clock in which what it speaks of happens, the least of all configurations.
    caught : list of str
        Planted bugs under which it fails; none where they were not run.
    """

    block: str
    property: Property
    sizes: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    seconds: float = 0.0
    depth: int = 0
    reached: int | None = None
    caught: list[str] = field(default_factory=list)

    def add(self, proof: Proof, verdict: Verdict) -> None:
        """Take in the verdict on a configuration that the property applies to."""
        name = self.property.name
        self.seconds += verdict.seconds
        self.depth = max(self.depth, verdict.depth)
        if name in verdict.reached:
            self.reached = min(verdict.reached[name], self.reached if self.reached is not None else verdict.depth)
        if name in verdict.failed:
            self.problems.append(f"{proof.size}: fails in clock {verdict.failed[name]}")
        elif name not in verdict.proved:
            self.problems.append(f"{proof.size}: not proved")
        else:
            self.sizes.append(proof.size)

    def finish(self) -> None:
        """Call a property failed that no configuration has, or that speaks of what never happens."""
        if not self.sizes and not self.problems:
            self.problems.append("no proof has it")
        elif self.reached is None:
            self.problems.append("what it speaks of never happens: an empty proof")

    def to_dict(self) -> dict[str, Any]:
        """Return what a report says of it."""
        return {
            "block": self.block,
            "property": self.property.name,
            "meaning": self.property.meaning,
            "sizes": self.sizes,
            "unbounded": not self.problems,
            "depth": self.depth,
            "first_seen": self.reached,
            "seconds": round(self.seconds, 1),
            "problems": self.problems,
            "mutants_caught": self.caught,
        }


def outcomes(verdicts: Iterable[tuple[Proof, Verdict]], whole: bool = True) -> list[Outcome]:
    """Return what the proofs say of every property of every block among them.

    Parameters
    ----------
    verdicts : iterable of (Proof, Verdict)
    whole : bool
        Whether all configurations are among them: then a property that none has is a failure.
    """
    found: dict[tuple[str, str], Outcome] = {}
    for proof, verdict in verdicts:
        applies = {p.name for p in proof.checker(proof.config).proved}
        for item in proof.checker.properties:
            if item.name in applies or whole:
                found.setdefault((proof.block, item.name), Outcome(proof.block, item))
            if item.name in applies:
                found[proof.block, item.name].add(proof, verdict)
    for outcome in found.values():
        outcome.finish()
    return list(found.values())


def closing_line(results: list[Outcome]) -> str:
    """Return the last line of ``make formal``."""
    failed = sum(bool(outcome.problems) for outcome in results)
    unbounded = len(results) - failed
    return f"proved: {len(results) - failed} properties, {unbounded} of them unbounded, {failed} failed"


def hunt(block: str, proofs: Iterable[Proof]) -> Iterator[tuple[Mutant, set[str]]]:
    """Plant every bug of a block in turn; yield it with the properties that fail by it.

    A bug is looked for in one configuration after the other, until all that it is known to break has failed.
    """
    grounds = [proof for proof in proofs if proof.block == block and proof.hunts]
    for mutant in mutants(block):
        failed: set[str] = set()
        for proof in grounds:
            if failed and failed >= set(mutant.fails):
                break
            with planted(mutant):
                failed |= set(solve(proof.checker(proof.config), proof.depth, 0).failed)
        yield mutant, failed


def judge(results: list[Outcome], found: Iterable[tuple[Mutant, set[str]]]) -> None:
    """Note by every property the planted bugs that it noticed; one that misses its own, or has too few, is a failure.

    Parameters
    ----------
    results : list of Outcome
        Of all properties of a block.
    found : iterable of (Mutant, set of str)
        Every bug planted into the block, and the properties that failed.
    """
    of = {outcome.property.name: outcome for outcome in results}
    for mutant, failed in found:
        for name in mutant.fails:
            if name in failed:
                of[name].caught.append(mutant.name)
            else:
                of[name].problems.append(f"holds although {mutant.name}")
    for outcome in results:
        if len(outcome.caught) < FEWEST_MUTANTS:
            outcome.problems.append(f"only {len(outcome.caught)} planted bugs show that it can fail")
