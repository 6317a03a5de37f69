"""Test the encoder benchmark, and its check for equal events."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from typer.testing import CliRunner

from eskin.model.encoders import registry

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "encoder.py"
SMALL = ["--signals", "128", "--samples", "300", "--rounds", "1"]


@pytest.fixture
def encoder(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(SCRIPT.parent))
    spec = importlib.util.spec_from_file_location("encoder", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "encoder", module)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module.os, "sched_setaffinity", lambda *_: None, raising=False)
    return module


def test_it_times_every_encoder_against_a_copy(encoder: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "numbers.json"
    result = CliRunner().invoke(encoder.app, [*SMALL, "--json", str(path)])
    assert result.exit_code == 0, result.output
    report = json.loads(path.read_text())
    events = {line["name"]: line["events"] for line in report["results"]}
    assert events["copy"] is None
    assert events["lcs"] == events["lcs, numpy over time"] > 0
    assert all(events[name] > 0 for name in registry.NAMES)


def test_it_fails_where_the_same_rule_gives_other_events(encoder: ModuleType, monkeypatch: Any) -> None:
    monkeypatch.setattr(encoder, "numpy_lcs", lambda config, samples, counts: None)
    result = CliRunner().invoke(encoder.app, SMALL)
    assert result.exit_code == 1
    assert "disagree" in result.output


def test_a_file_that_cannot_be_written_is_refused_at_once(encoder: ModuleType, tmp_path: Path) -> None:
    result = CliRunner().invoke(encoder.app, ["--json", str(tmp_path / "none" / "numbers.json")])
    assert result.exit_code == 2
