"""Compare the merge's RTL with a queue in every clock, with its contract, and with the golden model."""

from __future__ import annotations

from pathlib import Path

import pytest

from eskin.cocotb_tests.blocks.merge import play
from eskin.cocotb_tests.test_tiles import skin
from eskin.model.tiles.config import TilesConfig

CONFIGS = [
    skin(1, 2),
    skin(1, 1, reset="async"),
    skin(1, 3, rows=1, columns=1, encoding="nlcs", reset="async"),
    skin(4, 4, rows=64, columns=64),
]


@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: f"icarus-{config.tiles}")
def test_merge_keeps_its_contract_and_equals_its_models(config: TilesConfig, tmp_path: Path) -> None:
    counts = play(config, "icarus", tmp_path, seed=3)
    assert counts["transfers"] > 200
    assert counts["resets"] >= 5
    assert counts["Event"] >= counts["transfers"]
    assert counts["left in the last run"] > 40
