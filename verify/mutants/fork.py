"""Run a Python module in a forked process with preloaded libraries."""

from __future__ import annotations

import os
import resource
import runpy
import sys

OURS = ("eskin", "tests", "cocotb_tests", "conftest")


def play(place: str, words: list[str], log: str, limit_s: int) -> None:
    """Run a Python module with arguments in a copy of the checkout, with its output in a file.

    This process, and each that it starts, may use ``limit_s`` seconds of processor time.
    """
    os.setsid()
    resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s + 5))
    out = os.open(log, os.O_WRONLY | os.O_APPEND)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(out, 1)
    os.dup2(out, 2)
    os.chdir(place)
    os.environ |= {"PYTHONPATH": place, "ESKIN_HOLDOUT": "1", "OMP_NUM_THREADS": "1"}
    for name in [name for name in sys.modules if name.partition(".")[0] in OURS]:
        del sys.modules[name]
    sys.path[:] = [place, *(folder for folder in sys.path if folder and not os.path.isdir(f"{folder}/eskin"))]
    sys.argv = words[:]
    runpy.run_module(words[0], run_name="__main__", alter_sys=True)
