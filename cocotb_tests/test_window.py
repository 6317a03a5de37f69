"""Compare the closing window's RTL with the independent model in every clock: opening, closing and resets."""

import random
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from eskin.cocotb_tests.bench.block import Step
from eskin.cocotb_tests.independent.settings import Settings
from eskin.cocotb_tests.independent.taxel import Window
from eskin.cocotb_tests.runner.block import play_steps
from eskin.model.config import ReadoutConfig

CLOCKS = 1200


def steps(config: ReadoutConfig, rng: random.Random, counts: Counter[str]) -> Iterator[Step]:
    """Yield phases from quiet to busy, with resets."""
    settings = Settings.of(config.to_dict())
    window = Window(settings)
    for clock in range(CLOCKS):
        if clock % 300 == 0:
            opens, ticks = rng.choice([0.0, 0.02, 0.2]), rng.choice([1.0, 0.5])
        open_, tick, rst = rng.random() < opens, rng.random() < ticks, rng.random() < 0.003
        if rst and config.reset == "async":
            window.open()
        half_width = window.width // settings.closing_step
        narrows = tick and half_width > 1 and window.quiet + 1 == settings.window_period
        outputs = {"half_width": half_width, "closed": half_width == 1}
        outputs |= {"narrows": narrows} if config.asks_between_ticks else {}
        yield Step({"rst": rst, "open": open_, "tick": tick}, outputs, f"width {window.width}, quiet {window.quiet}")
        counts["narrowest"] += half_width == 1
        counts["opened"] += window.width < settings.step and open_
        counts["resets"] += rst
        if open_ or rst:
            window.open()
        elif tick:
            window.tick()


BASE = ReadoutConfig(rows=1, columns=1, encoding="cw-lcs", resolution=6, window_period=3)
CONFIGS = [
    BASE,
    BASE.replace(frontend="analog", window_period=4, reset="async"),
    BASE.replace(window_period=1, closing_shift=16, resolution=5, reset="async"),
    BASE.replace(frontend="analog", window_period=5, closing_shift=1),
]


@pytest.mark.representative("analog-m1-5", "digital-m16-1", block="window")
@pytest.mark.parametrize(
    "config", CONFIGS, ids=lambda c: f"{c.frontend}-m{c.closing_shift}-{c.window_period}-{c.reset}"
)
def test_window_equals_its_reference_in_every_clock(config: ReadoutConfig, tmp_path: Path) -> None:
    counts = play_steps(config, "icarus", "eskin_window", steps, tmp_path, seed=5)
    assert counts["checks"] == (3 if config.asks_between_ticks else 2) * CLOCKS
    assert all(counts[what] > 0 for what in ("narrowest", "opened", "resets")), counts
