"""Run one command in this process, and judge its visible results."""

import contextlib
import faulthandler
import io
import os
import resource
import signal
import sys
import time
import traceback
import unicodedata
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import NamedTuple

from eskin.app.cli import app, run

CASES, SEED, COUNTS = 60, None, None
if piece := os.environ.get("ESKIN_FUZZ"):
    cases, number, folder = piece.split(" ", 2)
    CASES, SEED, COUNTS = int(cases), int(number), Path(folder)
"""For a piece of a long campaign: cases, seed, and the folder for the log of all cases and for the counts."""
LONGEST_CPU_S = 30
"""Of this process: no case here takes three; one that takes so long has found a loop without end."""
LONGEST_S = 600
"""By the clock, for what waits instead of computing; a busy machine makes a case ten times as long."""
AGAIN_S = 1.0
"""From one signal to the next: a broad except may have caught the first."""
MAX_BYTES = 6 * 2**30
"""Address space that a case may add: torch and Numba map much and use little."""


Command = tuple[str, ...]
"""Words after ``eskin``."""


class Seen(NamedTuple):
    """Results of a command; ``crash`` is a traceback, or empty."""

    code: int | None
    out: str
    err: str
    crash: str


def run_command(command: Command) -> Seen:
    """Run a command in the current folder."""
    out, err, crash, code = io.StringIO(), io.StringIO(), "", None
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        _limits(command[0] not in ("verilog", "gates")),
    ):
        try:
            run(app, "eskin", command)
        except SystemExit as left:
            code = left.code if isinstance(left.code, int) else None
        except BaseException:
            crash = traceback.format_exc()
    return Seen(code, out.getvalue(), err.getvalue(), crash)


@contextlib.contextmanager
def _limits(memory: bool) -> Iterator[None]:
    """Limit time and memory of the enclosed work."""

    def too_long(number: int, frame: FrameType | None) -> None:
        limit = f"{LONGEST_CPU_S} s of computing" if number == signal.SIGPROF else f"{LONGEST_S} s"
        raise AssertionError(f"still running after {limit}")

    before, most = resource.getrlimit(resource.RLIMIT_AS)
    mapped = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    timers = ((signal.ITIMER_PROF, signal.SIGPROF, LONGEST_CPU_S), (signal.ITIMER_REAL, signal.SIGALRM, LONGEST_S))
    handlers = {number: signal.signal(number, too_long) for _, number, _ in timers}
    for timer, _, limit in timers:
        signal.setitimer(timer, limit, AGAIN_S)
    faulthandler.dump_traceback_later(
        LONGEST_S + 60, exit=True, file=sys.__stderr__
    )  # native code sees no signal of Python's
    if memory:
        resource.setrlimit(resource.RLIMIT_AS, (mapped + MAX_BYTES, most))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (before, most))
        faulthandler.cancel_dump_traceback_later()
        for timer, number, _ in timers:
            signal.setitimer(timer, 0)
            signal.signal(number, handlers[number])


def tree(folder: Path) -> dict[str, int]:
    """Return every file in a folder with its size."""
    return {str(path.relative_to(folder)): path.stat().st_size for path in folder.rglob("*") if path.is_file()}


def complaint(command: Command, seen: Seen, before: dict[str, int], after: dict[str, int]) -> str:
    """Return the defect in the results of a command; empty if none."""
    if seen.crash:
        return f"traceback: {seen.crash}"
    if seen.code not in (0, 1, 2):
        return f"exit code {seen.code}"
    if seen.code == 1 and command[0] not in ("compare", "predict"):
        return f"exit code 1: {seen.out[-300:]}"
    if any(unicodedata.category(sign) == "Cc" and sign not in "\n\t" for sign in seen.out + seen.err):
        return f"output that a terminal obeys: {(seen.out + seen.err)[-500:]!r}"
    if "Traceback" in seen.err + seen.out:
        return f"a traceback was printed: {seen.err[-500:]}"
    if seen.code == 2:
        sentences = [line for line in seen.err.splitlines() if line.startswith("error: ")]
        if len(sentences) != 1 or not seen.err.rstrip().splitlines()[-1].startswith("error: "):
            return f"not one sentence: {seen.err[-500:]!r}"
        if sentences[0].startswith("error: not enough memory"):
            return sentences[0]
        if changed := {n for n in before | after if before.get(n) != after.get(n)}:
            return f"files were left or changed by a refused command: {sorted(changed)[:5]}"
    return ""


def checked(command: Command, root: Path) -> int | None:
    """Run a command and return its exit code; fail if its results, or what it left in a folder, have a defect."""
    before = tree(root)
    line = " ".join(["eskin", *(word if word.isprintable() else repr(word) for word in command)])
    if COUNTS:
        with (COUNTS / "log.txt").open("a") as log:
            log.write(f"{time.strftime('%H:%M:%S')} {line}"[:2000] + "\n")
    seen = run_command(command)
    if wrong := complaint(command, seen, before, tree(root)):
        raise AssertionError("\n    ".join([line[:400], *wrong.strip().splitlines()[-3:]]))
    return seen.code
