"""Test the encoder benchmark, and its check for equal events."""

import json
from pathlib import Path
from types import ModuleType
from typing import Any

from eskin.model.encoders import registry

NAME = "encoder"
SMALL = ["--signals", "128", "--samples", "300", "--rounds", "1"]


def test_it_times_every_encoder_against_a_copy(invoke: Any, tmp_path: Path) -> None:
    path = tmp_path / "numbers.json"
    result = invoke(*SMALL, "--json", path)
    assert result.exit_code == 0, result.output
    report = json.loads(path.read_text())
    events = {line["name"]: line["events"] for line in report["results"]}
    assert events["copy"] is None
    assert events["lcs"] == events["lcs, numpy over time"] > 0
    assert all(events[name] > 0 for name in registry.NAMES)


def test_it_fails_where_the_same_rule_gives_other_events(program: ModuleType, invoke: Any, monkeypatch: Any) -> None:
    monkeypatch.setattr(program, "numpy_lcs", lambda config, samples, counts: None)
    result = invoke(*SMALL)
    assert result.exit_code == 1
    assert "disagree" in result.output


def test_a_file_that_cannot_be_written_is_refused_at_once(invoke: Any, tmp_path: Path) -> None:
    result = invoke("--json", tmp_path / "none" / "numbers.json")
    assert result.exit_code == 2
