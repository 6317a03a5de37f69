"""Run the proofs, summarise the results, and write them to ``docs/data/verification/formal.json``."""

import hashlib
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

from eskin.base.files import origin, write_json
from eskin.base.outputs import has_earlier
from eskin.base.shapes import read_shaped
from eskin.base.workers.engine import Needs, Pool, each
from eskin.base.workers.store import Store
from eskin.rtl import yosys
from eskin.verify.proofs.bench import design
from eskin.verify.proofs.engine import Verdict, solve
from eskin.verify.proofs.mutants import is_equivalent, mutants
from eskin.verify.proofs.plan import Proof, proofs

NEEDS = Needs(("base", "model", "rtl", "verify"), ("amaranth", yosys.PACKAGE))
"""Packages and libraries that must be equal on all workers of a cluster."""

YOSYS = version(yosys.PACKAGE)
"""Version of Yosys, which runs the proofs and generates the mutants."""

FEWEST_MUTANTS = 3
"""Smallest number of generated mutants that must violate every property."""

DRAWN, MAX_DRAWS = 40, 12
"""Number of mutants per draw in a configuration, and largest number of draws for a property with too few mutants."""


@dataclass
class Outcome:
    """The combined result of all proofs for one property of one block."""

    block: str
    name: str
    meaning: str
    sizes: list[str] = field(default_factory=list)  # configurations in which the property was proved
    problems: list[str] = field(default_factory=list)  # reasons why the property counts as failed
    seconds: float = 0.0  # of the whole block: the solver takes its properties together
    depth: int = 0  # clocks of the deepest search for a failure
    reached: int | None = None  # first clock in which its case happens in any configuration
    mutants: int = 0  # generated mutants that violate the property

    def add(self, proof: Proof, verdict: Verdict) -> None:
        """Add the result for a configuration."""
        name = self.name
        self.seconds += verdict.seconds
        self.depth = max(self.depth, verdict.depth)
        if name in verdict.reached:
            self.reached = min(verdict.reached[name], self.reached if self.reached is not None else verdict.depth)
        if name in verdict.failed:
            self.problems.append(f"{proof.size}: fails in clock {verdict.failed[name]}")
        elif name not in verdict.proved:
            self.problems.append(f"{proof.size}: not proved")
        elif name not in verdict.reached:
            self.problems.append(
                f"{proof.size}: what it speaks of never happens in {verdict.depth} clocks: an empty proof"
            )
        else:
            self.sizes.append(proof.size)

    def to_dict(self) -> dict[str, Any]:
        """Return the result as an entry of the report."""
        return {
            "block": self.block,
            "property": self.name,
            "meaning": self.meaning,
            "sizes": self.sizes,
            "unbounded": not self.problems,
            "depth": self.depth,
            "first_seen": self.reached,
            "seconds": round(self.seconds, 1),
            "problems": self.problems,
            "mutants": self.mutants,
        }


def outcomes(verdicts: Iterable[tuple[Proof, Verdict]], whole: bool = True) -> list[Outcome]:
    """Return the result for every property of every block.

    If the ``whole`` plan was proved, a property that no configuration has is a failure.
    """
    found: dict[tuple[str, str], Outcome] = {}
    for proof, verdict in verdicts:
        applies = proof.checker(proof.config).proved
        for name, meaning in proof.checker.properties.items():
            if name in applies or whole:
                outcome = found.setdefault((proof.block, name), Outcome(proof.block, name, meaning))
                if name in applies:
                    outcome.add(proof, verdict)
    for outcome in found.values():
        if not outcome.sizes and not outcome.problems:
            outcome.problems.append("no proof has it")
    return list(found.values())


def closing_line(problems: Collection[list[str]]) -> str:
    """Return the final message of ``make formal``."""
    failed = sum(map(bool, problems))
    proved = len(problems) - failed
    return f"proved: {proved} properties, {proved} of them unbounded, {failed} failed"


@dataclass(frozen=True)
class MutantRun:
    """Mutants of a block in one configuration, and the properties that each violates."""

    block: str
    size: str
    seed: int  # seed of the mutants
    # failed properties by the arguments of Yosys' ``mutate``; none where the mutant survives
    mutants: dict[str, list[str]]
    equivalent: list[str] = field(default_factory=list)  # survivors that are proved equivalent to the block

    @property
    def killed(self) -> int:
        """Mutants that violate a property."""
        return sum(bool(failed) for failed in self.mutants.values())


def hunt(proof: Proof, seed: int) -> MutantRun:
    """Generate mutants of a block in one configuration, and find the properties that each violates.

    All checkers of the block in this configuration look for a failure.
    """
    checker, found = proof.checker(proof.config), MutantRun(proof.block, proof.size, seed, {})
    for mutant in mutants(checker, DRAWN, seed):
        if is_equivalent(checker, mutant):
            found.equivalent.append(mutant.name)
        found.mutants[mutant.name] = [] if mutant.name in found.equivalent else failures(proof, mutant.rtlil)
    return found


def failures(proof: Proof, rtlil: str, depth: int | None = None) -> list[str]:
    """Return the properties that a mutant violates within a number of clocks, of every checker of its configuration."""
    own = (proof.checker.block, proof.config)
    judges = [one for one in proofs() if (one.checker.block, one.config) == own]
    found = (solve(one.checker(one.config), depth or one.depth, 0, rtlil, cases=False).failed for one in judges)
    return sorted(name for failed in found for name in failed)


def fingerprint(proof: Proof) -> str:
    """Return a digest of block, checker and bench of a proof."""
    return hashlib.sha256(design(proof.checker(proof.config))[0].encode()).hexdigest()[:16]


def prove(proof: Proof, limit_s: int) -> dict[str, Any]:
    """Return the verdict of the solvers on a proof in a form that JSON can hold."""
    return solve(proof.checker(proof.config), proof.depth, limit_s).to_dict()


def verdicts(
    proofs: Sequence[Proof], limit_s: int, pool: Pool, store: Store | None = None
) -> Iterator[tuple[Proof, Verdict]]:
    """Yield every proof with its verdict, in order; verdicts on equal designs are taken from the store."""

    def name(proof: Proof, limit_s: int) -> str:
        return f"proof {proof.block} {proof.depth} {limit_s} {fingerprint(proof)}"

    found = each(pool, prove, ((proof, limit_s) for proof in proofs), store=store, name=name)
    for proof, fields in zip(proofs, found, strict=True):
        yield proof, Verdict.from_dict(fields)


def hunts(proofs: Sequence[Proof], pool: Pool, store: Store | None = None) -> Iterator[MutantRun]:
    """Generate and test mutants of the proofs that hunt, in rounds, until each property fails for enough mutants.

    Results on equal designs are taken from the store.
    """

    def name(proof: Proof, seed: int) -> str:
        return f"hunt {proof.block} {proof.size} {proof.depth} {seed} {fingerprint(proof)}"

    count: Counter[tuple[str, str]] = Counter()
    for seed in range(MAX_DRAWS):
        wanting = [
            (proof, seed)
            for proof in proofs
            if proof.hunts
            and any(count[proof.block, name] < FEWEST_MUTANTS for name in proof.checker(proof.config).proved)
        ]
        for fields in each(pool, _hunt, wanting, store=store, name=name):
            found = MutantRun(**fields)
            count.update((found.block, name) for failed in found.mutants.values() for name in failed)
            yield found


def _hunt(proof: Proof, seed: int) -> dict[str, Any]:
    return asdict(hunt(proof, seed))


def judge(results: list[Outcome], found: Iterable[MutantRun]) -> None:
    """Count the mutants that violate each property; a property violated by too few mutants fails."""
    of = {outcome.name: outcome for outcome in results}
    drawn = 0
    for one in found:
        drawn += len(one.mutants)
        for name in (name for failed in one.mutants.values() for name in failed):
            of[name].mutants += 1
    for outcome in results:
        if outcome.mutants < FEWEST_MUTANTS:
            outcome.problems.append(f"fails by only {outcome.mutants} of {drawn} generated mutants")


def mutants_line(results: list[Outcome], found: list[MutantRun]) -> str:
    """Return a line with the numbers of generated and killed mutants."""
    drawn, killed = sum(len(one.mutants) for one in found), sum(one.killed for one in found)
    fewest = min(outcome.mutants for outcome in results)
    return f"mutants: {drawn} generated, {killed} killed; every property fails by {fewest} of them or more"


def earlier(path: Path | None) -> dict[str, Any]:
    """Return the results stored in a file; empty for a device or FIFO."""
    if path is None or not has_earlier(path):
        return {}
    rows = {"properties": [{"block": str, "problems": [str]}], "hunts": [{"block": str}]}
    found: dict[str, Any] = read_shaped(path, "the results of proofs", rows)
    return found


def write(results: list[Outcome], found: list[MutantRun], path: Path, command: str, block: str = "") -> None:
    """Write the results of properties and mutants with command, commit and date.

    If one ``block`` alone was proved, the file keeps its results of other blocks.
    """
    here = origin(command)
    rows: dict[str, list[dict[str, Any]]] = {
        "properties": [outcome.to_dict() | {"commit": here["commit"]} for outcome in results],
        "hunts": [
            asdict(one) | {"mutants": {mutant: ", ".join(failed) for mutant, failed in one.mutants.items()}}
            for one in found
        ],
    }
    if block and (kept := earlier(path)):
        blocks = dict.fromkeys(row["block"] for row in kept["properties"])
        for key, own in rows.items():
            others = [row for row in kept[key] if row["block"] != block]
            rows[key] = sorted(others + own, key=lambda row: list(blocks | {block: None}).index(row["block"]))
    result = closing_line([row["problems"] for row in rows["properties"]])
    write_json(path, {**here, "yosys": YOSYS, "result": result, **rows})
