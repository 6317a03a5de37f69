"""Tests without a simulation, in a process of their own with a mutant planted; there it is a plugin of pytest."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import asdict

import pytest

from cocotb_tests.session.store import ROOT
from flow.formal.mutants import planted
from flow.mutants.changes import Change
from flow.mutants.model.forks import WORDS, first_of

JOB = "ESKIN_PLANTED"
"""Environment variable with the edit, as JSON; empty for the original."""

LIMIT_S = 300


def first_failed(tests: Sequence[str], change: Change | None) -> str:
    """Return the first of some tests that fails with an edit of the RTL, or with none; an empty text if all pass."""
    environment = os.environ | {JOB: json.dumps(asdict(change)) if change else "", "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "pytest", *WORDS, "-p", __name__, *tests]
    try:
        done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=LIMIT_S)
    except subprocess.TimeoutExpired:
        return f"{' '.join(tests)} (never ends)"
    return (first_of(done.stdout) or " ".join(tests)) if done.returncode else ""


@pytest.hookimpl(wrapper=True)
def pytest_cmdline_main() -> Iterator[None]:
    """Plant the edit before any test is read, until all have run."""
    edit = os.environ[JOB]
    with planted(Change(**{**json.loads(edit), "fails": ()})) if edit else nullcontext():
        return (yield)
