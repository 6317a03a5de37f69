"""Compare the register file's RTL with its model in every clock: registers, unused addresses, counters."""

from pathlib import Path

import pytest

from eskin.cocotb_tests.blocks import registers
from eskin.cocotb_tests.runner.block import play_steps
from eskin.model.config import ReadoutConfig

BASE = ReadoutConfig(registers="spi")
CONFIGS = [
    BASE,
    BASE.replace(rows=3, columns=5, encoding="nlcs", reset="async", leak_period=100),
    BASE.replace(rows=1, columns=1, encoding="cw-lcs", resolution=1, window_period=1),
    BASE.replace(rows=5, columns=9, encoding="cw-lcs", window_period=2**16, closing_shift=4),
]


def name(config: ReadoutConfig) -> str:
    return f"{config.rows}x{config.columns}-{config.encoding}-{config.reset}"


@pytest.mark.representative("3x5-nlcs")
@pytest.mark.parametrize("config", CONFIGS, ids=name)
def test_file_equals_its_model_in_every_clock(config: ReadoutConfig, tmp_path: Path) -> None:
    counts = play_steps(config, "icarus", "eskin_registers", registers.steps, tmp_path, 11)
    assert counts["checks"] > 8 * registers.CLOCKS
    assert all(counts[what] > 30 for what in ("holes", "refused", "taken", "counted True")), counts
