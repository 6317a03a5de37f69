"""Compare the whole readout with the model: encoders, arrays, links, front ends, sinks, masks and resets."""

import itertools
from pathlib import Path
from typing import Any

import pytest

from eskin.cocotb_tests.bench.stimuli import scenario_count, scenarios
from eskin.cocotb_tests.runner import cocotb_runners as runners
from eskin.cocotb_tests.runner.process import play_runs, scenario_runs
from eskin.cocotb_tests.runner.reproduce import reproduce
from eskin.cocotb_tests.runner.simulator import Build, build
from eskin.model.address_events import taxel_of
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.readout import simulate

ARRAYS = [(1, 1), (1, 4), (3, 5), (8, 8), (5, 9)]
ENCODINGS = list(registry.NAMES)
RESOLUTIONS = [1, 6, 10]
VARIANTS = list(
    itertools.product(["stream", "four_phase"], ["digital", "analog"], ["sync", "async"], ["clock", "sample"])
)


def play(config: ReadoutConfig, program: Build, folder: Path, seed: int = 0) -> None:
    """Play the scenarios of a seed; runs must end both with and without outstanding requests."""
    again = reproduce(config, program.simulator, seed)
    tally = play_runs(program, scenario_runs(config, seed, again), folder)
    assert tally.runs == scenario_count(config)
    assert tally.events > 0
    assert tally.drained > 0
    assert tally.cut > 0


def breadth() -> list[ReadoutConfig]:
    """Return configurations with every encoding on every array; other fields vary.

    Any two values of any two of these meet: a third of the runs of a full product, of which few bugs need three.
    """
    fields = ("encoding", "rows", "columns", "resolution", "link", "frontend", "reset", "decide_every")
    timing = {"window_period": 3, "leak_period": 5}
    pairs = itertools.product(enumerate(ENCODINGS), enumerate(ARRAYS))
    return [
        ReadoutConfig.from_dict(
            timing
            | dict(
                zip(
                    fields,
                    (encoding, *array, RESOLUTIONS[(e + a + 2) % 3], *VARIANTS[9 * i % len(VARIANTS)]),
                    strict=True,
                )
            )
        )
        for i, ((e, encoding), (a, array)) in enumerate(pairs)
    ]


def name(config: ReadoutConfig) -> str:
    """Return the name of a configuration in the list of tests."""
    return (
        f"{config.encoding}-{config.rows}x{config.columns}-{config.resolution}b-{config.link}-{config.frontend}"
        f"-{config.reset}-{config.decide_every}"
    )


@pytest.mark.parametrize("config", breadth(), ids=name)
def test_rtl_equals_model_in_every_encoding_array_and_resolution(config: ReadoutConfig, tmp_path: Path) -> None:
    play(config, build(config, "icarus"), tmp_path, seed=ARRAYS.index((config.rows, config.columns)))


def test_any_two_values_of_two_settings_meet() -> None:
    values = [
        (c.encoding, (c.rows, c.columns), c.resolution, c.link, c.frontend, c.reset, c.decide_every) for c in breadth()
    ]
    for one, other in itertools.combinations(zip(*values, strict=True), 2):
        assert len(set(zip(one, other, strict=True))) == len(set(one)) * len(set(other))


LISTED: Any = [[[0, 1, 2], 0], [[3, 3, 3], 1], [[], 0], [[0, 1, 2, 3], 2]]
FIELDS = [
    ReadoutConfig(
        rows=3, columns=5, fields="neighbours", encoding="cw-lcs", window_period=3, sample_bits=8, resolution=4
    ),
    ReadoutConfig(rows=5, columns=2, fields="both", encoding="nlcs-bipolar", leak_period=7, link="four_phase_dual"),
    ReadoutConfig(rows=2, columns=3, fields="both", frontend="analog"),
    ReadoutConfig(rows=2, columns=2, sample_bits=8, resolution=3, fields=LISTED, reference_reset=-96),
]


LARGE = ReadoutConfig(rows=12, columns=16, link="four_phase_dual", encoding="nlcs-bipolar")


@pytest.mark.parametrize("config", [*FIELDS, LARGE], ids=name)
def test_rtl_equals_model_with_receptive_fields_and_in_a_large_array(config: ReadoutConfig, tmp_path: Path) -> None:
    play(config, build(config, "icarus"), tmp_path, seed=1)


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
