"""All mutants one after the other, kept as they come, so that a stopped campaign goes on where it was."""

from __future__ import annotations

import hashlib
import json
import random
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from flow.mutants.argued import argue
from flow.mutants.changes import Change, changes
from flow.mutants.facts import FACTS, Facts
from flow.mutants.judge import UNFIT, Finding, Judge
from flow.mutants.plan import GROUNDS
from flow.mutants.suite import Suite
from model.files import keep_line, kept_lines, origin, write_json

OF_MODEL = "model_and_snn"
"""The other campaign, within the file of that of the RTL."""

FINDINGS = "findings.jsonl"
"""The log in the folder of a campaign."""

FEWEST = 24
"""Mutants of a module, where it has so many."""


def chosen(blocks: Iterable[str], share: float, seed: int) -> list[Change]:
    """Return a share of all edits of some blocks: of each file one from every stretch of it, drawn at random.

    Which are drawn from a file does not depend on the others.
    """
    picked: list[Change] = []
    for file, ground in GROUNDS.items():
        if ground.block in blocks:
            every = changes(file)
            count = min(len(every), max(FEWEST, round(share * len(every))))
            ends = [number * len(every) // count for number in range(count + 1)]
            rng = random.Random(f"{seed} {file}")
            picked += [every[rng.randrange(*stretch)] for stretch in pairwise(ends)]
    return sorted(picked, key=lambda change: hashlib.sha256(change.name.encode()).hexdigest())


def run(
    picked: list[Change],
    folder: Path,
    seed: int,
    on_finding: Callable[[Finding], None],
    again: bool = False,
    judging: bool = True,
) -> list[Finding]:
    """Judge mutants, those already judged left out, keep each in a log, and return all findings.

    Parameters
    ----------
    picked : list of Change
    folder : Path
        Of the log and of what is found on the way.
    seed : int
        Of the configurations that no test has.
    on_finding : callable
        Called with every finding.
    again : bool
        Whether those alive, or killed by another test than those of the quick check, are judged once more: tests are
        new. What a mutant passed is not asked again, unless the test's file has changed.
    judging : bool
        Whether to judge those that were not judged yet.
    """
    judged = known(folder, again)

    def keep(finding: Finding) -> None:
        judged[finding.key] = finding
        keep_line(folder / FINDINGS, finding.to_dict())
        on_finding(finding)

    todo = [change for change in picked if change.key not in judged]

    def ask(suite: Suite) -> None:
        _note_quick(suite, judged.values())
        judge = Judge(suite, Facts(folder / FACTS), seed, keep)
        files = [file for file in GROUNDS if any(change.file == file for change in todo)]
        left = {file: judge.test(file, [change for change in todo if change.file == file]) for file in files}
        for file in files:  # what is left takes most of the time: tests of whole readouts, and proofs
            judge.conclude(file, left[file])

    todo = todo if judging else []
    if todo or judged:
        tests = {test for change in picked for test in GROUNDS[change.file].tests}
        Suite().collect([f"cocotb_tests/test_{test}.py" for test in sorted(tests)], ask)
    found = [judged[change.key] for change in picked if change.key in judged]
    argue(found)
    return found


def known(folder: Path, again: bool) -> dict[str, Finding]:
    """Return what was found before and is not judged once more, by the keys of the mutants."""
    found = {finding.key: finding for finding in read(folder / FINDINGS)}
    if again:
        found = {key: one for key, one in found.items() if one.quick or one.verdict not in ("alive", "killed")}
    return found


def _note_quick(suite: Suite, findings: Iterable[Finding]) -> None:
    """Say of mutants that a test of today's quick check has killed that the quick check does."""
    names = {name for name, item in suite.items.items() if item.get_closest_marker("quick")}
    for finding in findings:
        finding.quick |= finding.by.partition(" (")[0] in names


def read(log: Path) -> Iterator[Finding]:
    """Yield what a log holds."""
    for fields in kept_lines(log):
        yield Finding(**{**fields, "differs": tuple(fields["differs"])})


def unfit(folder: Path) -> dict[str, str]:
    """Return why a test could not be asked, by its name: it fails with the original RTL too, in this campaign."""
    return Facts(folder / FACTS).of(UNFIT)


def _counted(findings: list[Finding]) -> dict[str, int]:
    """Return how many mutants there are, and what became of them."""
    real = [finding for finding in findings if finding.verdict != "stillborn"]
    return {
        "total": len(real),
        "equivalent": sum(finding.verdict == "equivalent" for finding in real),
        "argued": sum(finding.verdict == "argued" for finding in real),
        "killed": sum(finding.verdict == "killed" for finding in real),
        "killed_quick": sum(finding.quick for finding in real),
        "alive": sum(finding.verdict == "alive" for finding in real),
    }


def summary(findings: list[Finding], planned: int, unfit: Mapping[str, str]) -> dict[str, Any]:
    """Return what a campaign found as JSON content, without its origin; ``unfit`` are tests that were not asked.

    Mutants that the generator refuses are told apart and count nowhere else: no Verilog comes of them.
    """
    alive = [finding.to_dict() for finding in findings if finding.verdict == "alive"]
    return {
        "result": closing_line(findings, planned, len(unfit)),
        "planned": planned,
        **_counted(findings),
        "stillborn": sum(finding.verdict == "stillborn" for finding in findings),
        **{
            f"per_{name}": {
                value: _counted([finding for finding in findings if getattr(finding, name) == value])
                for value in sorted({getattr(finding, name) for finding in findings})
            }
            for name in ("block", "kind")
        },
        "survivors": alive,
        "argued_one_by_one": [
            {"name": finding.name, "why": finding.why} for finding in findings if finding.verdict == "argued"
        ],
        "by_a_property_alone": sum(finding.by.startswith("property ") for finding in findings),
        "not_asked": dict(unfit),
        "only_by_the_whole_suite": [
            {"name": finding.name, "by": finding.by}
            for finding in findings
            if finding.verdict == "killed" and not finding.quick
        ],
    }


def closing_line(findings: list[Finding], planned: int, unfit: int = 0) -> str:
    """Return the last line of ``make mutants``; ``unfit`` tests fail with the original too, and kill nothing."""
    count = _counted(findings)
    rest = count["total"] - count["equivalent"] - count["argued"]
    shares = [f"{100 * count[name] / rest:.1f} %" if rest else "none" for name in ("killed", "killed_quick")]
    left = f", {planned - len(findings)} not yet judged" if planned > len(findings) else ""
    same = f"{count['equivalent']} of them proved equivalent, {count['argued']} argued"
    killed = f"of the others {count['killed']} killed ({shares[0]}), by the quick check alone {shares[1]}"
    silent = f"; tests not asked, for they fail with the original: {unfit}" if unfit else ""
    return f"mutants: {count['total']}, {same}; {killed}; {count['alive']} alive{left}{silent}"


def write(path: Path, command: str, content: dict[str, Any], part: str = "") -> None:
    """Write what a campaign found, with the command, the commit and the date; what the file has of the other stays.

    Parameters
    ----------
    path : Path
    command : str
    content : dict
        See ``summary``.
    part : str
        Name of the campaign within the file; that of the RTL is the file itself.
    """
    kept = json.loads(path.read_text()) if path.exists() else {}
    found = {**origin(command), **content}
    if part:
        kept[part] = found
    else:
        kept = found | ({OF_MODEL: kept[OF_MODEL]} if OF_MODEL in kept else {})
    write_json(path, kept)
