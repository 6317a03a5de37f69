"""Compare the closing window's RTL with a reference in every clock: opening, closing and resets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cocotb
import pytest

from eskin.cocotb_tests.bench.block import begin, report
from eskin.cocotb_tests.runner.block import cosimulate
from eskin.model.config import ReadoutConfig

CLOCKS = 1200


class WindowReference:
    """Reference model of the window: half-width in closing steps, and ticks since its last change."""

    def __init__(self, config: ReadoutConfig) -> None:
        self.widest, self.period = 2**config.closing_levels_log2, config.window_period
        self.reset()

    def reset(self) -> None:
        """Open the window fully."""
        self.half_width, self.quiet = self.widest, 0

    def clock(self, *, opens: bool, tick: bool) -> None:
        """Apply a rising edge."""
        if opens:
            self.reset()
        elif tick:
            self.quiet += 1
            if self.quiet == self.period:
                self.quiet = 0
                self.half_width = max(self.half_width - 1, 1)


@cocotb.test()
async def window_follows_its_reference(dut: Any) -> None:
    """Play phases from quiet to busy, with resets."""
    config, rng, block, check = begin(dut)
    reference = WindowReference(config)
    block.drive(open=0, tick=0)
    await block.reset()
    for clock in range(CLOCKS):
        if clock % 300 == 0:
            opens, ticks = rng.choice([0.0, 0.02, 0.2]), rng.choice([1.0, 0.5])
        inputs = {"open": rng.random() < opens, "tick": rng.random() < ticks}
        rst = rng.random() < 0.003
        block.drive(rst=rst, **inputs)
        await block.settle()
        if rst and config.reset == "async":
            reference.reset()
        check.equal("half_width", reference.half_width, block.read("half_width"), inputs | vars(reference))
        check.equal("closed", reference.half_width == 1, block.read("closed"), inputs | vars(reference))
        check.counts["narrowest"] += reference.half_width == 1
        check.counts["opened"] += reference.half_width < reference.widest and inputs["open"]
        await block.edge()
        reference.clock(opens=inputs["open"], tick=inputs["tick"])
        if rst:
            reference.reset()
            check.counts["resets"] += 1
    report(check.counts)


BASE = ReadoutConfig(rows=1, columns=1, encoding="cw-lcs", resolution=6, window_period=3)
CONFIGS = [
    BASE,
    BASE.replace(frontend="analog", reset="async"),
    BASE.replace(window_period=1, closing_shift=16, resolution=5, reset="async"),
    BASE.replace(frontend="analog", window_period=5, closing_shift=1),
]


@pytest.mark.parametrize(
    "config", CONFIGS, ids=lambda c: f"{c.frontend}-m{c.closing_shift}-{c.window_period}-{c.reset}"
)
def test_window_equals_its_reference_in_every_clock(config: ReadoutConfig, tmp_path: Path) -> None:
    counts = cosimulate(config, "icarus", "eskin_window", "window_follows_its_reference", tmp_path, seed=5)
    assert counts["checks"] == 2 * CLOCKS
    assert all(counts[what] > 0 for what in ("narrowest", "opened", "resets")), counts
