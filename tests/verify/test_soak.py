"""Test that the soak adds up its runs, finds a faulty readout, and reduces the difference to one command."""

import dataclasses
import json
import re
import shlex
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import strategies as st

import eskin.cocotb_tests.runner.simulator as simulator
from eskin.base.workers.engine import Local
from eskin.cocotb_tests.bench.random_run import MAX_SAMPLES, RandomRun, runs
from eskin.model.config import ReadoutConfig
from eskin.verify import soak
from tests.conftest import run_eskin as call

FAST = ("dev", "soak", "--sim", "icarus")


def test_a_soak_adds_to_the_totals_of_the_same_rtl(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(soak, "BATCH", 2)
    clock, told = [0.0], list[dict[str, Any]]()
    monkeypatch.setattr(soak, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    plan = soak.Plan(60, 4, 300, "icarus", tmp_path / "soak.json")

    def until_over(found: list[dict[str, Any]]) -> None:
        told.extend(found)
        clock[0] = 60.0  # the time is over when a seed is done

    totals = {}
    for seeds in (1, 2):
        clock[0] = 0.0
        told.clear()
        totals = soak.soak(plan, Local(1), until_over)
        assert (totals["seeds"], totals["runs"]) == (seeds, 2 * seeds)
    assert json.loads((tmp_path / "soak.json").read_text()) | totals == json.loads((tmp_path / "soak.json").read_text())
    assert (totals["runs"], totals["clocks"]) == (len(told), sum(run["clocks"] for run in told))
    assert sum(totals["by"]["encoding"].values()) == 4
    assert re.fullmatch(r"soak: [\d,]+ clocks, [\d,]+ events, 4 configurations, 0 mismatches", totals["result"])
    monkeypatch.setattr(soak, "SOURCES", "others")
    assert soak.soak(dataclasses.replace(plan, seconds=0), Local(1), until_over)["runs"] == 0


def test_a_broken_readout_becomes_one_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = simulator.verilog_text
    before, after = "event_polarity = |(", "event_polarity = ~|("
    drawn = st.builds(RandomRun, st.just(ReadoutConfig(rows=1, columns=2)), clocks=st.integers(1, 100))
    monkeypatch.setattr(simulator, "verilog_text", lambda config: text(config).replace(before, after))
    monkeypatch.setattr(simulator, "BUILD", tmp_path)
    monkeypatch.setattr(soak, "runs", lambda clocks: drawn)  # every configuration builds a program
    failed = call(*FAST, "--workers", 1, "--hours", 1, "--clocks", 100)
    assert failed.returncode == 1, failed.stderr
    assert failed.stdout.endswith("MISMATCH\n")
    assert "RTL and model differ" in failed.stdout
    (command,) = re.findall(r"^reproduce: (eskin dev soak .*)$", failed.stdout, re.MULTILINE)
    run = RandomRun.from_json(shlex.split(command)[-1])
    assert 0 < run.clocks < 20
    again = call(*shlex.split(command)[1:])
    assert again.returncode == 1
    assert f"reproduce: {command}" in again.stdout
    monkeypatch.setattr(simulator, "verilog_text", text)
    monkeypatch.setattr(simulator, "BUILD", tmp_path / "good")
    assert call(*shlex.split(command)[1:]).stdout.startswith(f"bit-exact: 1 runs, {run.clocks} clocks, ")


def test_a_run_is_read_as_it_is_written() -> None:
    config = ReadoutConfig(rows=2, columns=1, receptive_fields=[[[0, 1], 1], [[], 0]], registers="spi", resolution=3)  # type: ignore[arg-type]
    run = RandomRun(config, 7, 93, "near", 12, "slow", 3, noisy=True)
    assert RandomRun.from_json(run.to_json()) == run
    assert "encoding" not in run.to_json()  # a default


def test_drawn_runs_fit_the_memory() -> None:
    def too_long(run: RandomRun) -> bool:
        assert run.clocks * 2 / (run.gap + 1) * run.config.taxels <= MAX_SAMPLES
        return False

    assert soak.search(runs(2_000_000), too_long, 50, 1) is None


@pytest.mark.command("soak")
@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("--hours -1", "--hours must be in 0..10000, not -1.0"),
        ("--only {} --seed 1", "--seed has no effect with --only; leave one of the two out"),
        ("--only {", "a run is a line of JSON, as a difference is printed: Expecting property name enclosed in double "
         "quotes: line 1 column 2 (char 1)"),
        ('--only {"config":{},"row":1}',
         "a run is a line of JSON, as a difference is printed: RandomRun.__init__() got an unexpected keyword argument "
         "'row'"),
        ('--only {"config":{"rows":65}}', "rows must be in 1..64, not 65"),
        ('--only {"config":{},"signal":"sine"}',
         "signal must be one of hold, noise, walk, square, near, rare, not 'sine'"),
        ('--only {"config":{},"gap":0}', "gap must be in 1..1000000, not 0"),
    ],
)  # fmt: skip
def test_mistakes_are_one_sentence(words: str, sentence: str, refuses: Any) -> None:
    refuses(f"error: {sentence}\n", "dev soak --sim icarus", words)
