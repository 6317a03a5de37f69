"""Test the network benchmark, and its check for equal results."""

import json
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from eskin.snn.kernels import cpu as kernel

NAME = "network"
SMALL = ["--steps", "12", "--batch", "4", "--rate", "0.3", "--rounds", "1"]

pytestmark = pytest.mark.skipif(not kernel.available(), reason="no C++ compiler for the kernel")


def test_it_times_the_kernel_against_loop_and_limit(invoke: Any, tmp_path: Path) -> None:
    path = tmp_path / "numbers.json"
    result = invoke(*SMALL, "--json", path)
    assert result.exit_code == 0, result.output
    (report,) = json.loads(path.read_text())["results"]
    ours, loop = (report["candidates"][name] for name in ("this project, kernel", "plain torch loop"))
    assert ours["spikes"] == loop["spikes"]
    assert ours["spikes"][0] > 0
    assert ours["times_the_limit"] > 0
    assert report["limit_cpu_s"]["median"] > 0


def test_it_fails_where_a_candidate_gives_other_spikes(program: ModuleType, invoke: Any, monkeypatch: Any) -> None:
    wrong = program.NeuronRule(floor=-0.1, surrogate="fast-sigmoid", surrogate_scale=1.0, surrogate_width=1.0)
    make = (lambda: program.ours(wrong, program.layer), program.RULE, False)
    monkeypatch.setitem(program.CANDIDATES, "this project, torch", make)
    result = invoke(*SMALL)
    assert result.exit_code == 1
    assert "Not all candidates give the same" in result.output
