"""Test the decay counter: row r leaks at sample ticks j with j mod P = floor(r P / rows)."""

import random
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from eskin.cocotb_tests.bench.block import Step
from eskin.cocotb_tests.runner.block import play_steps
from eskin.model.config import ReadoutConfig

CLOCKS = 1000


def steps(config: ReadoutConfig, rng: random.Random, counts: Counter[str]) -> Iterator[Step]:
    """Yield dense and rare sample ticks with resets between them."""
    period = config.leak_period
    phases = sorted({row * period // config.rows for row in range(config.rows)})
    ticks = 0
    for clock in range(CLOCKS):
        often = 1.0 if clock % 500 < 300 else 0.2
        tick, rst = rng.random() < often, rng.random() < 1 / (8 * period)
        if rst and config.reset == "async":
            ticks = 0
        expected = sum(1 << bit for bit, phase in enumerate(phases) if tick and ticks % period == phase)
        inputs = {"tick": tick, "rst": rst, "period": period, "restart": 0}  # the last two where registers set them
        yield Step(inputs, {"decay": expected}, f"sample tick {ticks}")
        counts["decays"] += expected != 0
        counts["last"] += ticks % period == period - 1 and tick
        counts["resets"] += rst
        ticks = 0 if rst else ticks + tick


BASE = ReadoutConfig(rows=3, columns=1, encoding="nlcs")
CONFIGS = [
    BASE.replace(leak_period=5),
    BASE.replace(rows=8, leak_period=2, reset="async"),  # several rows in each phase
    BASE.replace(rows=64, leak_period=64),
    BASE.replace(leak_period=7, registers="spi"),
]


@pytest.mark.representative("3-rows-5", "3-rows-7", block="decay")
@pytest.mark.parametrize("config", CONFIGS, ids=lambda c: f"{c.rows}-rows-{c.leak_period}-{c.reset}-{c.registers}")
def test_decay_ticks_are_those_of_the_rule(config: ReadoutConfig, tmp_path: Path) -> None:
    counts = play_steps(config, "icarus", "eskin_decay", steps, tmp_path, seed=6)
    assert counts["checks"] == CLOCKS
    assert all(counts[what] > 0 for what in ("decays", "last", "resets")), counts
