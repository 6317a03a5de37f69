"""Compare the test pattern's RTL with its model in every clock: modes, rates, restarts, random grants."""

from pathlib import Path

import pytest

from eskin.cocotb_tests.blocks import pattern
from eskin.cocotb_tests.runner.block import play_steps
from eskin.model.config import ReadoutConfig

BASE = ReadoutConfig(registers="spi")
CONFIGS = [
    BASE.replace(rows=3, columns=5),
    BASE.replace(rows=1, columns=4, encoding="nlcs"),
]


@pytest.mark.representative("3x5-lcs")
@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: f"{config.rows}x{config.columns}-{config.encoding}")
def test_pattern_equals_its_model_in_every_clock(config: ReadoutConfig, tmp_path: Path) -> None:
    counts = play_steps(config, "icarus", "eskin_pattern", pattern.steps, tmp_path, 13)
    assert counts["taken"] > 200
    assert counts["withdrawn"] > 0
    assert counts["waits"] > 50 or config.rows == 1
