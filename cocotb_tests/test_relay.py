"""Compare the relay station's RTL with a queue in every clock, with its contract, and with the golden model."""

from __future__ import annotations

from pathlib import Path

import pytest

from eskin.cocotb_tests.blocks.relay import play
from eskin.cocotb_tests.test_tiles import skin
from eskin.model.tiles.config import TilesConfig

CONFIGS = [
    skin(1, 2, relays=1),
    skin(1, 2, relays=1, rows=1, columns=1, encoding="nlcs", reset="async"),
    skin(1, 2, relays=1, rows=3, columns=5, encoding="nlcs", reset="async"),
]


@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: f"icarus-{config.tile.event_bits}b-{config.reset}")
def test_relay_keeps_its_contract_and_equals_its_model(config: TilesConfig, tmp_path: Path) -> None:
    counts = play(config, "icarus", tmp_path, seed=5)
    assert counts["transfers"] > 200
    assert counts["resets"] == 5
    assert counts["Event"] > counts["transfers"]  # some wait
    assert counts["left in the last run"] > 40
