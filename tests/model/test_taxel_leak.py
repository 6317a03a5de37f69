"""Compare the event rate of N-LCS with that of a floating-point leaky neuron."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from eskin.model.config import ReadoutConfig
from eskin.model.taxel import count_events


def leaky(**parameters: Any) -> ReadoutConfig:
    """Return the configuration of one N-LCS taxel of 12 bits."""
    return ReadoutConfig(rows=1, columns=1, encoding="nlcs", **parameters)


@pytest.mark.parametrize(("shift", "period"), [(6, 63), (5, 127)])
@pytest.mark.parametrize("level", [1.5, 100])
def test_nlcs_fires_with_the_period_of_the_leaky_neuron(level: float, shift: int, period: int) -> None:
    config = leaky(resolution=6, leak_shift=shift, leak_period=period)
    x, d = round(level * config.step), config.step
    ticks = 2_000_000
    spikes = int(count_events(config, np.full((ticks, 1), x, np.int16))[0])
    seconds = ticks / config.sample_rate_hz / (config.tau_s * math.log(x / (x - d)))
    # The leak comes in steps of 2**-k: the threshold is passed by half a step on average.
    assert -(2.0**-shift) / 2 - 0.003 < spikes / seconds - 1 < 0.003


@pytest.mark.parametrize("x", [-2048, -1, 0, 1, 16])
def test_nlcs_never_fires_up_to_one_step(x: int) -> None:
    config = leaky(resolution=6)
    assert config.step == 16
    assert count_events(config, np.full((100_000, 1), x, np.int16))[0] == 0


@pytest.mark.parametrize(("shift", "tolerance"), [(5, 0.005), (6, 0.003)])
def test_nlcs_keeps_the_rate_of_an_exponential_on_a_moving_signal(shift: int, tolerance: float) -> None:
    config = leaky(resolution=8, leak_shift=shift, leak_period=round(4000 / (2**shift - 0.5)))  # 4000 ticks
    ticks = np.arange(200_000)
    x = np.round(600 * np.sin(ticks / 150) + 400 * np.sin(ticks / 211 + 1)).astype(np.int16)
    u, spikes, keep = 0.0, 0, math.exp(-1 / config.sample_rate_hz / config.tau_s)
    for code in x.tolist():
        fresh = max(math.ceil((code - u) / config.step) - 1, 0)
        u, spikes = (u + fresh * config.step) * keep, spikes + fresh
    assert count_events(config, x[:, None])[0] == pytest.approx(spikes, rel=tolerance)
