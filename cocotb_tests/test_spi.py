"""Compare the SPI slave's RTL with its model in every clock, and test it with an asynchronous host."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from eskin.cocotb_tests.blocks.spi import CLOCKS, play
from eskin.model.config import ReadoutConfig

if TYPE_CHECKING:
    from eskin.cocotb_tests.runner.cocotb_runners import Simulator


CONFIG = ReadoutConfig(rows=1, columns=1, registers="spi")


@pytest.mark.parametrize(("simulator", "reset"), [("icarus", "sync"), ("icarus", "async")])
def test_slave_equals_its_model_in_every_clock(simulator: Simulator, reset: str, tmp_path: Path) -> None:
    config = ReadoutConfig.from_dict(CONFIG.to_dict() | {"reset": reset})
    counts = play(config, simulator, "slave_follows_its_model", tmp_path, 7)
    assert counts["checks"] == 5 * (CLOCKS - 2)
    assert all(counts[what] > 5 for what in ("writes", "ones read", "broken off", "locked out")), counts
    assert counts["resets"] > 0


@pytest.mark.parametrize("simulator", ["verilator"])
def test_host_of_another_clock_is_understood_at_the_stated_pace(simulator: Simulator, tmp_path: Path) -> None:
    counts = play(CONFIG, simulator, "host_of_another_clock_reads_what_it_wrote", tmp_path, 9)
    assert min(counts["WrittenAsSent"], counts["ReadAsKept"]) > 7
