"""Test the limits of the scale: overdriven signals and random decisions in the model, and late events in decoders."""

import dataclasses

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.readout import Stimulus, simulate, state_at
from eskin.model.taxel import decode
from tests.independent.agreement import play

CLOCKS = 4000
BASE = ReadoutConfig(rows=2, columns=2, frontend="analog", resolution=3, leak_shift=6, leak_period=3, window_period=2)
CONFIGS = [
    BASE,
    BASE.replace(sample_bits=16, resolution=1, decide_every="sample"),
    BASE.replace(encoding="cw-lcs", link="four_phase", resolution=1),
    BASE.replace(encoding="cw-lcs", closing_shift=4, decide_every="sample"),
    BASE.replace(encoding="nlcs"),
    BASE.replace(encoding="nlcs", decide_every="sample", fraction_bits=0, leak_period=1, leak_shift=12),
]


def held(config: ReadoutConfig, level: int) -> Stimulus:
    samples = np.full((CLOCKS // 8, config.taxels), level)
    return Stimulus.from_samples(config, samples, clocks_per_sample=8)


@pytest.mark.parametrize("config", CONFIGS, ids=lambda c: f"{c.encoding}-{c.decide_every}")
def test_random_decisions_for_thousands_of_clocks_never_wrap(config: ReadoutConfig) -> None:
    rng = np.random.default_rng(5)
    up = np.arange(CLOCKS)[:, None] % 1000 < 500  # the walk drifts to one end, and to the other
    often, seldom = (rng.random((CLOCKS, config.taxels)) < p for p in (0.7, 0.2))
    decisions = np.where(up, often + 2 * seldom, seldom + 2 * often).astype(np.uint8)
    stimulus = dataclasses.replace(held(config, 0), decisions=decisions)
    events = simulate(config, stimulus)
    assert events.tolist() == play(config, stimulus)[0].tolist()
    assert len(events) > (300 if config.has_polarity else 50)
    unit = 1 << config.encoder.fraction_bits(config)
    seen = np.array([state_at(config, stimulus, clock).reference for clock in range(0, CLOCKS, 40)]) // unit
    assert seen.max() < config.full_scale
    assert seen.min() >= config.encoder.lowest(config)
    assert seen.max() >= config.full_scale - 2 * config.step
    assert not config.has_polarity or seen.min() < -config.full_scale + 2 * config.step


def test_decisions_and_signals_that_do_not_fit_are_refused() -> None:
    digital, some = BASE.replace(frontend="digital"), np.zeros((CLOCKS, 4), np.uint8)
    with pytest.raises(InputError, match=r"^samples must be in -2048\.\.2047 \(12 bits\), not 0\.\.2048$"):
        held(digital, 0).from_samples(digital, np.array([[0, 0, 0, 2048]]))
    with pytest.raises(InputError, match=r"^samples must be in -8192\.\.8191 .* not 0\.\.8192$"):
        held(BASE, 0).from_samples(BASE, np.array([[0, 0, 0, 8192]]))
    with pytest.raises(InputError, match=r"^decisions need the analog front end; set frontend to analog$"):
        simulate(digital, dataclasses.replace(held(digital, 0), decisions=some))
    with pytest.raises(InputError, match=r"^decisions must have shape \(4000, 4\), a row for every clock$"):
        simulate(BASE, dataclasses.replace(held(BASE, 0), decisions=some[1:]))


@pytest.mark.parametrize("encoding", registry.NAMES)
def test_decoders_never_leave_the_scale(encoding: str) -> None:
    config = BASE.replace(encoding=encoding, frontend="digital", leak_shift=9)
    low = -9 if config.has_polarity else 0
    counts = np.random.default_rng(2).integers(low, 10, (400, config.taxels)).astype(np.int16)
    counts[200:] = np.abs(counts[200:])
    rebuilt = decode(config, counts, np.zeros(counts.shape, bool))
    assert -config.full_scale <= rebuilt.min()
    assert config.full_scale - config.step <= rebuilt.max() < config.full_scale
