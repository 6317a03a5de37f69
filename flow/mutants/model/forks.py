"""What runs in a copy of the checkout: tests in forks of a process that has the large packages, for one edit each."""

from __future__ import annotations

import json
import math
import os
import re
import resource
import shutil
import signal
import sys
import time
from pathlib import Path
from typing import Any

CPU_S, WALL_S = 120, 300
"""Seconds that the tests of one edit may take: an endless loop counts as a failure."""

TEST_S = 30
"""Seconds of one test, of which the longest takes a third with what it compiles."""

WORDS = ("-q", "-x", "--tb=no", "-rfE", "-p", "no:cacheprovider", "-p", "no:xdist", "-o", "addopts=")
"""Options of pytest, which then names the first test that fails."""

FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.MULTILINE)
LOG = "said.txt"


def serve() -> None:
    """Run the tests of each line on standard input, a JSON list; answer with exit code and the first that failed."""
    import hypothesis
    import numba  # noqa: F401
    import scipy.signal  # noqa: F401
    import torch

    torch.set_num_threads(1)
    hypothesis.settings.register_profile(
        "first failure", phases=[hypothesis.Phase.explicit, hypothesis.Phase.generate], derandomize=True, database=None
    )
    hypothesis.settings.load_profile("first failure")
    for line in sys.stdin:
        sys.stdout.write(json.dumps(_run(json.loads(line))) + "\n")
        sys.stdout.flush()


class Limit:
    """A plugin of pytest that gives every test seconds of its own."""

    @staticmethod
    def pytest_runtest_setup() -> None:
        """Count from here."""
        soon = min(CPU_S, math.ceil(time.process_time()) + TEST_S)
        resource.setrlimit(resource.RLIMIT_CPU, (soon, CPU_S + 5))


def _run(tests: list[str]) -> dict[str, Any]:
    child = os.fork()
    if not child:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S + 5))
        sys.stdout = sys.stderr = Path(LOG).open("w")  # noqa: SIM115 - until the fork ends
        for stream in (1, 2):
            os.dup2(sys.stdout.fileno(), stream)
        import pytest

        code = 3
        try:
            code = int(pytest.main([*WORDS, *tests], plugins=[Limit()]))
        finally:
            sys.stdout.flush()
            os._exit(code)
    code = _ended(child)
    shutil.rmtree(".hypothesis", ignore_errors=True)
    return {"code": code, "failed": first_of(Path(LOG).read_text(errors="replace"))}


def first_of(said: str) -> str:
    """Return the first test that failed, of what pytest said; an empty text if none is named."""
    found = FAILED.search(said)
    return found[1] if found else ""


def _ended(child: int) -> int:
    """Return the exit code of a child; one that takes too long is ended, which is a failure."""
    end = time.monotonic() + WALL_S
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return -signal.SIGKILL


if __name__ == "__main__":
    serve()
