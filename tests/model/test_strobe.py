"""Test the strobes of analog comparators: when they are asked, how often, and that strobes change no event."""

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.model.cases import axes, cases
from eskin.model.config import ReadoutConfig
from eskin.model.readout import Stimulus, comparisons, simulate, strobes

SMALL = ReadoutConfig(
    rows=2, columns=3, frontend="analog", resolution=4, clocks_per_sample=12, window_period=2, leak_period=3
)
TICKS = 60


def walk(config: ReadoutConfig, size: int) -> np.ndarray:
    """Return a random walk on the scale, shape (ticks, taxels)."""
    steps = np.random.default_rng(size).integers(-size, size + 1, (TICKS, config.taxels))
    return np.clip(np.cumsum(steps, axis=0), -config.full_scale, config.full_scale - 1)


CONFIGS = [*cases(SMALL, **axes("encoding", "decide_every"))]


@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: f"{config.encoding}-{config.decide_every}")
@pytest.mark.parametrize("size", [90, 400])
def test_strobed_comparators_give_the_events_of_comparators_in_every_clock(config: ReadoutConfig, size: int) -> None:
    samples, ready = walk(config, size), np.array([1, 0, 0, 1, 1, 0], np.uint8)
    strobed, digital = (
        simulate(one, Stimulus.from_samples(one, samples, ready=ready))
        for one in (config, config.replace(frontend="digital"))
    )
    assert len(strobed) > 10
    assert np.array_equal(strobed, digital)


@pytest.mark.representative
def test_a_taxel_asks_once_a_sample_and_once_after_an_event() -> None:
    quiet = Stimulus.from_samples(SMALL, np.zeros((TICKS, SMALL.taxels), np.int32))
    assert comparisons(SMALL, quiet) == TICKS * SMALL.taxels
    moving = Stimulus.from_samples(SMALL, walk(SMALL, 60))
    events = len(simulate(SMALL, moving))
    assert 10 < events == comparisons(SMALL, moving) - comparisons(SMALL, quiet)
    by_sample = SMALL.replace(decide_every="sample")
    assert comparisons(by_sample, moving) == TICKS * SMALL.taxels


def test_a_request_that_waits_asks_again_only_while_the_answer_is_a_step() -> None:
    config = SMALL.replace(rows=1, columns=1, clocks_per_sample=40)
    stalled = np.zeros(40, np.uint8)
    stalled[30] = 1  # the latch takes the first event at once, and the second waits
    asked = []
    for steps in (2, 3):
        stimulus = Stimulus.from_samples(config, np.full((1, 1), steps * config.step), ready=stalled)
        asked.append(np.flatnonzero(strobes(config, stimulus)).tolist())
    assert asked == [[1, 2, 3], [1, *range(2, 32)]]


def test_the_digital_front_end_has_no_strobes() -> None:
    digital = SMALL.replace(frontend="digital")
    quiet = Stimulus.from_samples(digital, np.zeros((1, digital.taxels), np.int32))
    with pytest.raises(InputError, match=r"^strobes need the analog front end; set frontend to analog, not digital$"):
        comparisons(digital, quiet)
