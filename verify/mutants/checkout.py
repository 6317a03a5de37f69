"""Copy the checkout for each mutant, and run tests and proofs there in separate processes."""

import contextlib
import hashlib
import math
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from eskin.base.cache import is_private
from eskin.base.errors import InputError
from eskin.cocotb_tests.runner.build_cache import ROOT, scratch_folder

PYTEST = ("pytest", "-q", "--tb=no", "-rfE", "-p", "no:cacheprovider", "--hypothesis-profile=ci", "-k", "not verilator")
"""Command that runs tests without cases on Verilator: they repeat tests on another simulator, and building takes
long."""

FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+?::\w+\[.*?\](?= - |$)|\S+)", re.MULTILINE)
"""Pattern for the names of failed tests; parameters in a name may contain spaces."""
PROPERTY = re.compile(r"^(\w+: \w+): ", re.MULTILINE)
PASSED = (0, 5)
"""Exit codes of pytest for tests that pass, or for no test."""
MOST_S, WAITS = 600, 6
"""Limit of processor time of a process in seconds, and the limit of elapsed time as a multiple of this limit."""
JUDGED = (1, 2, 4)
"""Exit codes of pytest for failing tests, or for tests that the mutant makes unreadable."""


@dataclass(frozen=True)
class Said:
    """Result of a command: exit code (None after a timeout) and output."""

    code: int | None
    text: str


def original(folder: Path) -> Path:
    """Return an unchanged copy of the checkout, whose builds all mutants share; raise InputError without a checkout."""
    listed = subprocess.run(["git", "ls-files", "-coz", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True)
    names = [name for name in sorted(listed.stdout.split("\0")) if name and os.path.lexists(ROOT / name)]
    if listed.returncode or not names:
        raise InputError(f"mutants need a git checkout, and {ROOT} is not a git checkout")
    digest = hashlib.sha256()
    for name in names:
        content = b"" if (ROOT / name).is_symlink() else (ROOT / name).read_bytes()  # eskin/ has links to the packages
        digest.update(f"{name}\0".encode() + content + b"\0")
    place = folder.resolve() / f"checkout-{digest.hexdigest()[:12]}"
    if not is_private(place):
        for old in folder.glob("checkout-*"):
            shutil.rmtree(old) if old.is_dir() else old.unlink()
        draft = Path(tempfile.mkdtemp(prefix=".checkout-", dir=folder))
        for name in names:
            (draft / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, draft / name, follow_symlinks=False)
        for compiled in {Path(name).parent / "__pycache__" for name in names}:
            if (ROOT / compiled).is_dir():
                shutil.copytree(ROOT / compiled, draft / compiled)
        (folder / "build").mkdir(exist_ok=True)
        (draft / "build").symlink_to(folder.resolve() / "build")
        draft.rename(place)
    return place


@contextmanager
def mutated(source: Path, file: str, text: str) -> Iterator[Path]:
    """Copy a checkout and change one file."""
    with scratch_folder(source.parent, "mutant") as place:
        shutil.copytree(source, place, symlinks=True, dirs_exist_ok=True, copy_function=os.link)
        for compiled in (place / file).parent.glob(f"__pycache__/{Path(file).stem}.*"):
            compiled.unlink()
        (place / file).unlink()  # a link to the original
        (place / file).write_text(text)
        yield place


def run(place: Path, words: Sequence[str], limit_s: float = MOST_S) -> Said:
    """Run a Python module in a copy of the checkout, with at most ``limit_s`` seconds of processor time per process."""
    most = math.ceil(limit_s)
    own = {"PYTHONPATH": str(place), "ESKIN_HOLDOUT": "1", "OMP_NUM_THREADS": "1"}
    with tempfile.TemporaryFile("w+", errors="replace") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", *words],
            cwd=place,
            env=os.environ | own,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (most, most + 5)),
        )
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(WAITS * limit_s)
        code = process.poll()
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        log.seek(0)
        return Said(code, log.read())


def first_failed(place: Path, tests: Sequence[str], checkout: Path, quick: bool, limit_s: float = MOST_S) -> str:
    """Return the first test that fails in ``place``, a copy with a mutant, and passes without; empty if none.

    ``quick`` selects the tests of ``make check``, or else all others. A process has ``limit_s`` seconds of processor
    time: an endless loop counts as a failure. RuntimeError is raised if pytest itself fails.
    """
    if quick:
        chosen = (checkout / "tests" / "quick.py").read_text()
        tests = [test for test in tests if test in chosen]
    if not tests:
        return ""
    while True:
        skipped = [word for test in failing(checkout) for word in ("--deselect", test)]
        said = run(place, [*PYTEST, "-m", "quick" if quick else "not quick", "-x", *skipped, *tests], limit_s)
        if said.code in PASSED:
            return ""
        if found := FAILED.search(said.text):
            if passes(checkout, found[1]):
                return found[1]
            if found[1] in skipped:
                raise RuntimeError(f"{found[1]} fails without a mutant and cannot be left out")
            continue
        if said.code is None or said.code == -signal.SIGXCPU:
            return f"{' '.join(tests)} (no end within {limit_s:.0f} s)"
        if said.code in JUDGED or (said.code < 0 and said.code != -signal.SIGKILL):
            return f"{' '.join(tests)} (exit code {said.code})"
        raise RuntimeError(f"pytest ends with {said.code}: {said.text[-2000:]}")


def passes(checkout: Path, test: str) -> bool:
    """Return True if a test passes without a mutant."""
    known, answers = _known(checkout)
    if test not in answers:
        words = [*PYTEST, *([] if "::" in test else ["--collect-only"]), test]  # a file that cannot be read
        answers[test] = "passes" if run(checkout, words).code in PASSED else "fails"
        with known.open("a") as file:
            file.write(f"{test} {answers[test]}\n")
    return answers[test] == "passes"


def _known(checkout: Path) -> tuple[Path, dict[str, str]]:
    """Return the file with what tests do in the unchanged code, and its content."""
    known = checkout.with_name(f"{checkout.name}-tests")
    return known, dict(line.rsplit(" ", 1) for line in known.read_text().splitlines()) if known.exists() else {}


def failing(checkout: Path) -> list[str]:
    """Return the tests that are known to fail in the unchanged code."""
    return [test for test, answer in _known(checkout)[1].items() if answer == "fails"]


def failed_property(place: Path, block: str, limit_s: float = MOST_S) -> str:
    """Return the first property of a block that is not proved, as ``block: property``; empty if all are.

    RuntimeError is raised if the proof itself fails.
    """
    said = run(place, ["eskin", "dev", "formal", "--block", block], limit_s)
    if said.code == 0:
        return ""
    if found := PROPERTY.search(said.text):
        return found[1]
    if said.code is None:
        return f"{block}: no end within {limit_s:.0f} s"
    raise RuntimeError(f"make formal BLOCK={block} ends with {said.code}: {said.text[-2000:]}")
