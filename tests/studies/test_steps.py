"""Test the model of LCS with adaptive steps."""

import numpy as np
import pytest

from eskin.model.address_events import taxel_of
from eskin.model.config import ReadoutConfig
from eskin.snn.data.record import recorded
from studies.steps import WANTED_HZ, Rule, count, fitted

CODES = np.random.default_rng(0).normal(0, 90, (400, 3)).cumsum(0).clip(-2048, 2047).astype(np.int32)


def test_a_fixed_step_of_a_power_of_two_gives_the_events_of_lcs() -> None:
    config = ReadoutConfig(rows=3, columns=1, resolution=2)
    events = recorded(config, CODES, {}).events
    counts = np.zeros((1, 6), np.int16)
    assert count(CODES, float(config.step), 1.0, 0.0, 400, counts) == len(events) > 50
    channels = taxel_of(events, config) + np.where(events["p"], 0, 3)
    assert counts[0].tolist() == np.bincount(channels, minlength=6).tolist()


def test_a_step_grows_with_each_event_up_to_a_limit_and_returns() -> None:
    codes = np.array([[0], [1000], [1000], [1100], [1250]])

    def counted(growth: float, stays: float) -> list[int]:
        counts = np.zeros((5, 2), np.int16)
        assert count(codes, 100.0, growth, stays, 1, counts) == counts.sum()
        return counts[:, 0].tolist()

    assert counted(2.0, 1.0) == [0, 3, 0, 1, 0], "steps of 100, 200, 400, and 400 again"
    assert counted(2.0, 0.0) == [0, 3, 2, 1, 1], "each tick begins with a step of 100"
    assert counted(1.0, 1.0) == [0, 10, 0, 1, 1]


def test_the_smallest_step_is_fitted_to_the_event_rate() -> None:
    rule, none = Rule("leaky-96", 1.5, 0.005), np.zeros((0, 1), np.int16)
    step = fitted(rule, [CODES], 20e3)
    seconds, stays = len(CODES) / 20e3, np.exp(-1 / 100)
    assert count(CODES, step, 1.5, stays, 1, none) / seconds <= WANTED_HZ
    assert count(CODES, step, 1.5, stays, 1, none) == pytest.approx(WANTED_HZ * seconds, abs=3)
