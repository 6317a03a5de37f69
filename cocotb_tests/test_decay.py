"""Test the decay counter: row r leaks at sample ticks j with j mod P = floor(r P / rows)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cocotb
import pytest

from eskin.cocotb_tests.bench.block import begin, report
from eskin.cocotb_tests.runner.block import cosimulate
from eskin.model.config import ReadoutConfig

CLOCKS = 1000


@cocotb.test()
async def decay_ticks_at_its_phases(dut: Any) -> None:
    """Play dense and rare sample ticks with resets between them."""
    config, rng, block, check = begin(dut)
    period = config.leak_period
    phases = sorted({row * period // config.rows for row in range(config.rows)})
    block.drive(tick=0, period=period, restart=0)  # the last two where registers set them
    await block.reset()
    ticks = 0
    for clock in range(CLOCKS):
        often = 1.0 if clock % 500 < 300 else 0.2
        tick, rst = rng.random() < often, rng.random() < 1 / (8 * period)
        block.drive(tick=tick, rst=rst)
        await block.settle()
        if rst and config.reset == "async":
            ticks = 0
        expected = sum(1 << bit for bit, phase in enumerate(phases) if tick and ticks % period == phase)
        check.equal("decay", expected, block.read("decay"), f"sample tick {ticks}, reset {rst}")
        check.counts["decays"] += expected != 0
        check.counts["last"] += ticks % period == period - 1 and tick
        await block.edge()
        ticks = 0 if rst else ticks + tick
        check.counts["resets"] += rst
    report(check.counts)


BASE = ReadoutConfig(rows=3, columns=1, encoding="nlcs")
CONFIGS = [
    BASE.replace(leak_period=5),
    BASE.replace(rows=8, leak_period=2, reset="async"),  # several rows in each phase
    BASE.replace(rows=64, leak_period=64),
    BASE.replace(leak_period=7, registers="spi"),
]


@pytest.mark.parametrize("config", CONFIGS, ids=lambda c: f"{c.rows}-rows-{c.leak_period}-{c.reset}-{c.registers}")
def test_decay_ticks_are_those_of_the_rule(config: ReadoutConfig, tmp_path: Path) -> None:
    counts = cosimulate(config, "icarus", "eskin_decay", "decay_ticks_at_its_phases", tmp_path, seed=6)
    assert counts["checks"] == CLOCKS
    assert all(counts[what] > 0 for what in ("decays", "last", "resets")), counts
