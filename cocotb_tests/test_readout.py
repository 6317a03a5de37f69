"""Compare the whole readout with the model: encoders, arrays, links, front ends, sinks, masks and resets."""

import functools
from pathlib import Path

import pytest

from eskin.cocotb_tests.bench.stimuli import scenario_count, scenarios
from eskin.cocotb_tests.runner import cocotb_runners as runners
from eskin.cocotb_tests.runner.process import play_runs, scenario_runs
from eskin.cocotb_tests.runner.reproduce import reproduce
from eskin.cocotb_tests.runner.simulator import Build, build
from eskin.model.address_events import taxel_of
from eskin.model.cases import AXES, CHOICES, pairs, values_of
from eskin.model.config import ReadoutConfig
from eskin.model.readout import simulate

BASE = ReadoutConfig(window_period=3, leak_period=9)
SHAPES = ((1, 1), (1, 4), (2, 3), (5, 9), (9, 2))
ARRAYS = tuple({"rows": rows, "columns": columns} for rows, columns in SHAPES)


def play(config: ReadoutConfig, program: Build, folder: Path, seed: int = 0) -> None:
    """Play the scenarios of a seed; runs must end both with and without outstanding requests."""
    repeat_command = reproduce(config, program.simulator, seed)
    tally = play_runs(program, scenario_runs(config, seed, repeat_command), folder)
    assert tally.runs == scenario_count(config)
    assert tally.events > 0
    assert tally.drained > 0
    assert tally.cut > 0


@functools.cache
def breadth() -> list[ReadoutConfig]:
    """Return configurations in which any two values of any two settings meet."""
    return pairs(BASE, **AXES | {"array": ARRAYS, "resolution": (1, 6, 10)})


def name(config: ReadoutConfig) -> str:
    """Return the name of a configuration in the list of tests."""
    values = values_of(config)
    others = "-".join(values[name] for name in CHOICES if name != "encoding")
    return f"{config.encoding}-{config.rows}x{config.columns}-{config.resolution}b-{others}"


LARGE = ReadoutConfig(rows=12, columns=16, link="four_phase_dual", encoding="nlcs-bipolar")


@pytest.mark.representative("lcs-2x3", "nlcs-9x2", block="readout")
@pytest.mark.parametrize("config", [*breadth(), LARGE], ids=name)
def test_rtl_equals_model_in_every_encoding_array_and_resolution(config: ReadoutConfig, tmp_path: Path) -> None:
    play(config, build(config, "icarus"), tmp_path, seed=config.taxels)


def test_verilator_sees_the_same_as_icarus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Optimising takes longer than these short runs; other tests replay on optimised programs.
    monkeypatch.setattr(runners, "OPTIMISE", "-O0")
    config = ReadoutConfig(rows=5, columns=9, encoding="cw-lcs", window_period=3, link="four_phase")
    play(config, build(config, "verilator"), tmp_path)


def test_an_array_built_row_by_row_is_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runners, "OPTIMISE", "-O0")
    config = ReadoutConfig(rows=4, columns=4, encoding="cw-lcs", window_period=3, frontend="analog", reset="async")
    program = build(config, "verilator", hierarchical=True)
    assert (program.folder / "Veskin_row" / "libeskin_row.a").exists()
    play(config, program, tmp_path)


def test_a_large_array_has_a_run_that_comes_to_rest() -> None:
    config = ReadoutConfig(rows=32, columns=16)
    runs = list(scenarios(config, seed=0))
    assert len(runs) == scenario_count(config) == scenario_count(ReadoutConfig()) + 1
    assert (runs[-1].name.partition(",")[0], runs[-1].outstanding) == ("few taxels", 0)
    events = simulate(config, runs[-1].stimulus)
    assert len(set(taxel_of(events, config).tolist())) == 8
