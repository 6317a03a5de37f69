"""Fixture of the benchmark that a test module names."""

from __future__ import annotations

import importlib
import os
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture
def program(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return the program ``NAME`` of the folder benchmarks as a module."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    monkeypatch.setattr(os, "sched_setaffinity", lambda *_: None, raising=False)  # a test keeps its cores
    return importlib.import_module(request.module.NAME)
