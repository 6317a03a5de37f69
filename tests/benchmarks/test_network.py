"""Test the network benchmark, and its check for equal results."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from typer.testing import CliRunner

from eskin.snn.kernels import cpu as kernel

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "network.py"
SMALL = ["--steps", "12", "--batch", "4", "--rate", "0.3", "--rounds", "1", "--no-memory"]

pytestmark = pytest.mark.skipif(not kernel.available(), reason="no C++ compiler for the kernel")


@pytest.fixture
def network(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(SCRIPT.parent))
    spec = importlib.util.spec_from_file_location("network_benchmark", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "network_benchmark", module)
    spec.loader.exec_module(module)
    return module


def test_it_times_the_kernel_against_loop_and_limit(network: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "numbers.json"
    result = CliRunner().invoke(network.app, [*SMALL, "--json", str(path)])
    assert result.exit_code == 0, result.output
    (report,) = json.loads(path.read_text())["results"]
    ours, loop = (report["candidates"][name] for name in ("this project, kernel", "plain torch loop"))
    assert ours["spikes"] == loop["spikes"]
    assert ours["spikes"][0] > 0
    assert ours["times_the_limit"] > 0
    assert report["limit_cpu_s"]["median"] > 0


def test_it_fails_where_a_candidate_gives_other_spikes(network: ModuleType, monkeypatch: Any) -> None:
    wrong = network.NeuronRule(floor=-0.1, surrogate="fast-sigmoid", surrogate_scale=1.0, surrogate_width=1.0)
    make = (lambda: network.ours(wrong, network.layer), network.RULE, False)
    monkeypatch.setitem(network.CANDIDATES, "this project, torch", make)
    result = CliRunner().invoke(network.app, SMALL)
    assert result.exit_code == 1
    assert "Not all candidates give the same" in result.output
