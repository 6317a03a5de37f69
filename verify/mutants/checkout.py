"""Make copies of the checkout, one for each mutant, and run tests and proofs there in their own processes."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from eskin.base.cache import is_private
from eskin.base.errors import InputError
from eskin.cocotb_tests.runner.build_cache import ROOT, scratch_folder
from eskin.cocotb_tests.runner.cocotb_runners import run_watched

PYTEST = ("pytest", "-q", "--tb=no", "-rfE", "-p", "no:cacheprovider", "--hypothesis-profile=ci", "-k", "not verilator")
"""Cases on Verilator are left out: they play the same test on another simulator, and building one takes long."""

FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.MULTILINE)
PROPERTY = re.compile(r"^(\w+: \w+): ", re.MULTILINE)
QUICK = ("-m", "quick")
NO_TESTS = 5
PASSED = (0, NO_TESTS)
JUDGED = (1, 2, 4)
"""Exit codes of pytest where tests fail, or cannot be read because of the mutant."""


@dataclass(frozen=True)
class Said:
    """The result of a command: exit code (None if stopped at its limit), output and seconds."""

    code: int | None
    text: str
    seconds: float


def original(folder: Path) -> Path:
    """Return an unchanged copy of the checkout, made if necessary; mutants share its builds.

    Raises
    ------
    InputError
        If there is no checkout.
    """
    listed = subprocess.run(["git", "ls-files", "-coz", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True)
    names = [name for name in sorted(listed.stdout.split("\0")) if name and os.path.lexists(ROOT / name)]
    if listed.returncode or not names:
        raise InputError(f"mutants are made of a checkout with git, and {ROOT} is none")
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
        for sources in {(ROOT / name).parent.relative_to(ROOT) for name in names}:  # what is compiled comes along
            for kernel in (ROOT / sources).glob("__pycache__/*.nb?"):
                (draft / sources / "__pycache__").mkdir(exist_ok=True)
                shutil.copy2(kernel, draft / sources / "__pycache__")
        (folder / "build").mkdir(exist_ok=True)
        (draft / "build").symlink_to(folder.resolve() / "build")
        draft.rename(place)
    return place


@contextmanager
def mutated(source: Path, file: str, text: str) -> Iterator[Path]:
    """Copy a checkout and change one file; compiled kernels of other files are copied, too."""
    with scratch_folder(source.parent, "mutant") as place:
        shutil.copytree(source, place, symlinks=True, dirs_exist_ok=True)
        for compiled in (place / file).parent.glob(f"__pycache__/{Path(file).stem}.*"):
            compiled.unlink()
        (place / file).write_text(text)
        yield place


def run(place: Path, words: Sequence[str], limit_s: float | None = None) -> Said:
    """Run a Python module in a copy of the checkout."""
    environment = os.environ | {"PYTHONPATH": str(place), "ESKIN_HOLDOUT": "1", "OMP_NUM_THREADS": "1"}
    begun = time.monotonic()
    with tempfile.TemporaryFile("w+", errors="replace") as log:
        code = run_watched([sys.executable, "-m", *words], place, environment, log, limit_s)
        log.seek(0)
        return Said(code, log.read(), time.monotonic() - begun)


def first_failed(place: Path, tests: Sequence[str], skipped: Sequence[str], limit_s: float, quick: bool) -> str:
    """Return the first test that fails, empty if all pass.

    Parameters
    ----------
    place : Path
        A copy of the checkout.
    tests : sequence of str
        Test files.
    skipped : sequence of str
        Tests that fail without a mutant too.
    limit_s : float
        Seconds that all of them may take: an endless loop counts as a failure.
    quick : bool
        Only those of ``make check``.

    Raises
    ------
    RuntimeError
        If pytest itself fails.
    """
    if not tests:
        return ""
    words = [*PYTEST, *QUICK * quick, "-x", *(word for test in skipped for word in ("--deselect", test)), *tests]
    said = run(place, words, limit_s)
    if said.code in PASSED:
        return ""
    if found := FAILED.search(said.text):
        return found[1]
    if said.code is None:
        return f"{' '.join(tests)} (no end within {limit_s:.0f} s)"
    if said.code in JUDGED or (said.code < 0 and said.code != -signal.SIGKILL):
        return f"{' '.join(tests)} (exit code {said.code})"
    raise RuntimeError(f"pytest ends with {said.code}: {said.text[-2000:]}")


def failing(place: Path, tests: Sequence[str], quick: bool) -> tuple[list[str], float]:
    """Return the tests that fail in a copy of the checkout, and the seconds that all of them take.

    Those of ``make check`` alone are run if ``quick``; there may be none.

    Raises
    ------
    RuntimeError
        If there are no tests, or pytest fails.
    """
    if not tests:
        raise RuntimeError("there are no tests")
    said = run(place, [*PYTEST, *QUICK * quick, *tests])
    failed = FAILED.findall(said.text)
    if said.code != 0 and not (said.code == 1 and failed) and not (said.code == NO_TESTS and quick):
        raise RuntimeError(f"the tests {' '.join(tests)} cannot be run: {said.text[-2000:]}")
    return failed, said.seconds


def failed_property(place: Path, block: str, limit_s: float | None = None) -> str:
    """Return the first property of a block that is not proved, as ``block: property``; empty if all are.

    Raises
    ------
    RuntimeError
        If the proof itself fails.
    """
    said = run(place, ["eskin", "dev", "formal", "--block", block], limit_s)
    if said.code == 0:
        return ""
    if found := PROPERTY.search(said.text):
        return found[1]
    if said.code is None:
        return f"{block}: no end within {limit_s:.0f} s"
    raise RuntimeError(f"make formal BLOCK={block} ends with {said.code}: {said.text[-2000:]}")
