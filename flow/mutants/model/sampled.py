"""A sample of mutants of ``model/`` and ``snn/``, each before the tests of its file alone; kept as they come."""

from __future__ import annotations

import hashlib
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from typing import Any

from cocotb_tests.session.store import ROOT
from flow.mutants.argued import argue
from flow.mutants.campaign import read
from flow.mutants.facts import Facts
from flow.mutants.judge import Finding
from flow.mutants.model.edits import Edit, sample
from flow.mutants.model.grounds import TESTS
from model.files import keep_line

FEWEST = 3
COPIED = ("model", "rtl", "snn", "cocotb_tests", "flow", "tests", "docs", "benchmarks")
COPIED_FILES = ("conftest.py", "pyproject.toml", "constraints.txt", "Makefile", "README.md")


def drawn(share: float, seed: int) -> tuple[list[Edit], dict[str, int]]:
    """Return a sample of all edits, file by file, and the places of each file."""
    picked: list[Edit] = []
    counts = {}
    for file in TESTS:
        found, counts[file] = sample(file, share, FEWEST, seed)
        picked += found
    return picked, counts


def judge(
    picked: list[Edit], folder: Path, again: bool, on_finding: Callable[[Finding], None], judging: bool = True
) -> list[Finding]:
    """Judge edits, those already judged left out, keep each in a log, and return all findings.

    Parameters
    ----------
    picked : list of Edit
    folder : Path
        Of the log.
    again : bool
        Whether those alive that no argument stands for are judged once more: tests are new.
    on_finding : callable
        Called with every finding.
    judging : bool
        Whether to judge those that were not judged yet.

    Raises
    ------
    RuntimeError
        If the tests of a file fail without an edit.
    """
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "model.jsonl"
    keys = {edit.key for edit in picked}
    known = {one.key: one for one in read(log) if one.key in keys}
    argue(known.values())
    if again:
        known = {key: one for key, one in known.items() if one.verdict != "alive"}
    todo = [edit for edit in picked if edit.key not in known] if judging else []
    facts = Facts(folder / "model_facts.jsonl")
    if todo:
        with _copy() as (place, ask):
            for file in dict.fromkeys(edit.file for edit in todo):
                own = [edit for edit in todo if edit.file == file]
                original = (place / file).read_text()
                for tests in _by_path(TESTS[file]):
                    if facts.get(whole := _question(tests)) is None:
                        code, failed = ask(tests)
                        if code:
                            raise RuntimeError(f"the tests of {file} fail without an edit: {failed or code}")
                        facts.add(whole, "pass")
                for edit in own:
                    (place / file).write_text(edit.text)
                    code, failed = ask(TESTS[file])
                    verdict = "killed" if code else "alive"
                    finding = Finding(edit.key, edit.name, Path(file).parts[0], file, edit.kind, verdict, by=failed)
                    known[edit.key] = finding
                    keep_line(log, finding.to_dict())
                    on_finding(finding)
                (place / file).write_text(original)
    found = [known[edit.key] for edit in picked if edit.key in known]
    argue(found)
    return found


def _by_path(tests: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """Yield tests by the file in which they stand."""
    for _, own in groupby(tests, key=_path):
        yield tuple(own)


def _path(test: str) -> str:
    return test.partition("::")[0]


def _question(tests: tuple[str, ...]) -> str:
    """Return whether tests of a file pass, as a question that is another one when it changes or what they are asked of.

    So tests that several files share are asked once.
    """
    files = [file for file, own in TESTS.items() if tests in _by_path(own)]
    texts = [(ROOT / name).read_bytes() for name in (_path(tests[0]), *files)]
    return f"{' '.join(tests)} {hashlib.sha256(b'|'.join(texts)).hexdigest()[:16]}"


@contextmanager
def _copy() -> Iterator[tuple[Path, Callable[[tuple[str, ...]], tuple[int, str]]]]:
    """Make a copy of the checkout; yield it, and what runs tests in it."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        place = Path(folder)
        leave = shutil.ignore_patterns("__pycache__")
        for name in COPIED:
            shutil.copytree(ROOT / name, place / name, ignore=leave)
        for name in COPIED_FILES:
            shutil.copy(ROOT / name, place / name)
        for step in ("init -q", "-c user.name=x -c user.email=x@x commit -q --allow-empty -m x"):  # results name one
            subprocess.run(["git", *step.split()], cwd=place, check=True)
        environment = os.environ | {"PYTHONPATH": folder, "ESKIN_HOLDOUT": "1", "OMP_NUM_THREADS": "1"}
        words = [sys.executable, "-m", "flow.mutants.model.forks"]
        with subprocess.Popen(
            words, cwd=place, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as server:
            assert server.stdin is not None
            assert server.stdout is not None

            def ask(tests: tuple[str, ...]) -> tuple[int, str]:
                server.stdin.write(json.dumps(tests) + "\n")  # type: ignore[union-attr]
                server.stdin.flush()  # type: ignore[union-attr]
                answer = json.loads(server.stdout.readline())  # type: ignore[union-attr]
                if answer["code"] == 5:
                    raise RuntimeError(f"there are no tests in {', '.join(tests)}")
                return answer["code"], answer["failed"]

            try:
                yield place, ask
            finally:
                server.stdin.close()


def summary(findings: list[Finding], planned: int, places: dict[str, int]) -> dict[str, Any]:
    """Return what was found of a sample as JSON content, without its origin; ``places`` are those of each file."""
    counts = _counted(findings)
    low, high = interval(counts["killed"], counts["killed"] + counts["alive"])
    return {
        "result": closing_line(findings, planned),
        "planned": planned,
        "places": sum(places.values()),
        **counts,
        "killed_share_95_percent": [round(low, 4), round(high, 4)],
        "per_file": {
            file: {"places": places[file], **_counted([finding for finding in findings if finding.file == file])}
            for file in sorted(places)
        },
        "survivors": [{"name": one.name, "kind": one.kind} for one in findings if one.verdict == "alive"],
        "argued_one_by_one": [{"name": one.name, "why": one.why} for one in findings if one.verdict == "argued"],
    }


def _counted(findings: list[Finding]) -> dict[str, int]:
    verdicts = [finding.verdict for finding in findings]
    return {"total": len(findings)} | {name: verdicts.count(name) for name in ("argued", "killed", "alive")}


def closing_line(findings: list[Finding], planned: int) -> str:
    """Return the last line of ``make mutants MODEL=1``."""
    count = _counted(findings)
    rest = count["killed"] + count["alive"]
    low, high = interval(count["killed"], rest)
    share = f"{100 * count['killed'] / rest:.1f} %" if rest else "none"
    left = f", {planned - len(findings)} not yet judged" if planned > len(findings) else ""
    return (
        f"mutants of model and snn: {count['total']}, {count['argued']} argued to be equivalent; of the others "
        f"{count['killed']} killed ({share}, 95 % interval {100 * low:.1f} to {100 * high:.1f} %); "
        f"{count['alive']} alive{left}"
    )


def interval(part: int, whole: int, z: float = 1.96) -> tuple[float, float]:
    """Return Wilson's interval of a share, 95 % (Wilson 1927)."""
    if not whole:
        return 0.0, 1.0
    share = part / whole
    middle = share + z * z / (2 * whole)
    half = z * math.sqrt(share * (1 - share) / whole + z * z / (4 * whole * whole))
    return (middle - half) / (1 + z * z / whole), (middle + half) / (1 + z * z / whole)
