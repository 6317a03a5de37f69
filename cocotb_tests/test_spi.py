"""Compare the SPI slave's RTL with its model in every clock, and test it with an asynchronous host."""

from pathlib import Path

import pytest

from eskin.cocotb_tests.blocks import spi
from eskin.cocotb_tests.runner.block import cosimulate, play_steps
from eskin.model.config import ReadoutConfig

CONFIG = ReadoutConfig(rows=1, columns=1, registers="spi")
CONFIGS = [CONFIG, CONFIG.replace(reset="async")]


@pytest.mark.representative("icarus-sync")
@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: f"icarus-{config.reset}")
def test_slave_equals_its_model_in_every_clock(config: ReadoutConfig, tmp_path: Path) -> None:
    counts = play_steps(config, "icarus", "eskin_spi", spi.steps, tmp_path, 7)
    assert counts["checks"] == 5 * spi.CLOCKS
    assert all(counts[what] > 5 for what in ("writes", "ones read", "broken off", "locked out")), counts
    assert counts["resets"] > 0


def test_host_of_another_clock_is_understood_at_the_stated_pace(tmp_path: Path) -> None:
    test = "host_of_another_clock_reads_what_it_wrote"
    counts = cosimulate(CONFIG, "verilator", "eskin_spi", test, tmp_path, 9, spi.__name__)
    assert min(counts["WrittenAsSent"], counts["ReadAsKept"]) > 7
