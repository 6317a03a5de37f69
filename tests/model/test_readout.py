"""Compare the fast model with the independent model, and check section 3 of docs/specification.md."""

import copy
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from numpy.typing import NDArray

from eskin.cocotb_tests.bench.random_run import RandomRun, runs
from eskin.model.config import ReadoutConfig
from eskin.model.readout import Stimulus, simulate, state_at
from eskin.model.taxel import EVENT_LATENCY
from tests.model.refused import refused

# -- the promises of section 3 -----------------------------------------------------------------------


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (1, 4), (5, 1), (3, 5), (64, 64)])
def test_saturated_array_sends_one_event_every_clock_and_serves_all_alike(rows: int, columns: int) -> None:
    config = ReadoutConfig(rows=rows, columns=columns, resolution=10)
    samples = np.full((1, config.taxels), 1500, np.int32)
    rounds = 7
    stimulus = Stimulus.from_samples(config, samples, clocks=EVENT_LATENCY + rounds * config.taxels)
    events = simulate(config, stimulus)
    assert events["t"].tolist() == list(range(EVENT_LATENCY, stimulus.clocks))
    taxel = events["y"].astype(int) * columns + events["x"]
    assert (np.bincount(taxel, minlength=config.taxels) == rounds).all()
    for number in range(rounds):  # and after every round
        assert (np.bincount(taxel[number * config.taxels :][: config.taxels]) == 1).all()


@settings(max_examples=40)
@given(runs(600, most_taxels=24))
def test_same_stimulus_gives_the_same_events_and_stays_untouched(run: RandomRun) -> None:
    config, stimulus = run.config, run.stimulus
    before = copy.deepcopy(stimulus)
    first = simulate(config, stimulus)
    assert np.array_equal(simulate(config, stimulus), first)
    for field in fields(Stimulus):
        assert np.array_equal(getattr(stimulus, field.name), getattr(before, field.name))


# -- refusals ----------------------------------------------------------------------------------------

GOOD = Stimulus.from_samples(ReadoutConfig(rows=1, columns=2), np.zeros((3, 2), np.int32))
SHAPE = "samples must have shape (ticks, 2) for 1 x 2 taxels, not "
RANGE = "samples must be in -2048..2047 (12 bits), not "
CODES = "samples must be integer codes, not {}; eskin.encode takes floats in full scales"
CLOCK = "sample_clock must be one rising clock for every row of samples"
ACK = "ack_delay must be positive and never a multiple of 8, or ACK changes at a clock edge"


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"samples": np.zeros((3, 3), np.int32)}, f"{SHAPE}(3, 3)"),
        ({"samples": np.zeros(3, np.int32)}, f"{SHAPE}(3,)"),
        ({"samples": np.array([[0, 0], [-2049, 5], [0, 0]])}, f"{RANGE}-2049..5"),
        ({"samples": np.array([[0, 0], [0, 2048], [0, 0]])}, f"{RANGE}0..2048"),
        *(({"sample_clock": np.array(clocks)}, CLOCK) for clocks in ([0, 4], [0, 4, 4], [-1, 4, 5])),
        ({"enable": np.ones((2, 2), bool)}, "enable must have shape (1, 2), one mask at least"),
        ({"enable": np.ones((1, 3), bool)}, "enable must have shape (1, 2), one mask at least"),
        (
            {"enable": np.ones((0, 2), bool), "enable_clock": np.zeros(0, np.int64)},
            "enable must have shape (0, 2), one mask at least",
        ),
        ({"enable_clock": np.array([1])}, "enable_clock must rise from 0"),
        ({"enable": np.ones((2, 2), bool), "enable_clock": np.array([0, 0])}, "enable_clock must rise from 0"),
        ({"ready": np.zeros(0, np.uint8)}, "ready and ack_delay must not be empty"),
        ({"ack_delay": np.zeros(0, np.int64)}, "ready and ack_delay must not be empty"),
        ({"ack_delay": np.array([1, 0])}, ACK),
        ({"ack_delay": np.array([1, 16])}, ACK),
    ],
)
def test_stimulus_that_does_not_fit_is_refused(changes: dict[str, Any], sentence: str) -> None:
    config = ReadoutConfig(rows=1, columns=2)
    bad = replace(GOOD, **changes)
    for call in (lambda: simulate(config, bad), lambda: state_at(config, bad, 0)):
        with refused(sentence):
            call()


@pytest.mark.parametrize(
    ("samples", "sentence"),
    [
        (np.full((1, 2), 0.9), CODES.format("float64")),
        (np.ones((1, 2), bool), CODES.format("bool")),
        (np.array([[0, 2**32]]), f"{RANGE}0..4294967296"),
        (np.array([[0, 2**63]], np.uint64), f"{RANGE}0..9223372036854775808"),
        (np.zeros((1, 3), int), f"{SHAPE}(1, 3)"),
    ],
)
def test_samples_are_checked_before_they_are_cast(samples: NDArray[Any], sentence: str) -> None:
    config = ReadoutConfig(rows=1, columns=2)
    with refused(sentence):
        Stimulus.from_samples(config, samples)
    with refused(sentence):
        simulate(config, replace(GOOD, samples=samples))
