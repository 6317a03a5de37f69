"""Fixtures of the benchmark that a test module names."""

import importlib
import os
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
import typer
from typer.testing import CliRunner, Result


@pytest.fixture
def program(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return the program ``NAME`` of the folder benchmarks as a module."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    monkeypatch.setattr(os, "sched_setaffinity", lambda *_: None, raising=False)  # a test keeps its cores
    return importlib.import_module(request.module.NAME)


@pytest.fixture
def invoke(program: ModuleType) -> Callable[..., Result]:
    """Return a function that runs the command line of the benchmark."""
    app = typer.Typer()
    app.command()(program.main)
    return lambda *words: CliRunner().invoke(app, [str(word) for word in words])
