"""Compare the relay station's RTL with the independent model in every clock."""

from pathlib import Path

import pytest

from eskin.cocotb_tests.blocks import merge
from eskin.cocotb_tests.runner.block import play_steps
from eskin.cocotb_tests.test_tiles import skin
from eskin.model.tiles.config import TilesConfig

CONFIGS = [
    skin(1, 2, relays=1),
    skin(1, 2, relays=1, rows=1, columns=1, encoding="nlcs", reset="async"),
    skin(1, 2, relays=1, rows=3, columns=5, encoding="nlcs", reset="async"),
]


@pytest.mark.representative("icarus-5b")
@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: f"icarus-{config.tile.event_bits}b-{config.reset}")
def test_relay_keeps_its_contract_and_equals_its_model(config: TilesConfig, tmp_path: Path) -> None:
    counts = play_steps(config, "icarus", "eskin_relay", merge.relay_steps, tmp_path, 5)
    assert counts["transfers"] > 200
    assert counts["withheld"] > 200
    assert counts["resets"] == 12
