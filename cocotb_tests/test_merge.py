"""Compare the merge's RTL with the independent model in every clock."""

from pathlib import Path

import pytest

from eskin.cocotb_tests.blocks import merge
from eskin.cocotb_tests.runner.block import play_steps
from eskin.cocotb_tests.test_tiles import skin
from eskin.model.tiles.config import TilesConfig

CONFIGS = [
    skin(1, 2),
    skin(1, 1, reset="async"),
    skin(1, 3, rows=1, columns=1, encoding="nlcs", reset="async"),
    skin(4, 4, rows=64, columns=64),
]


@pytest.mark.representative("icarus-3")
@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: f"icarus-{config.tiles}")
def test_merge_keeps_its_contract_and_equals_its_models(config: TilesConfig, tmp_path: Path) -> None:
    counts = play_steps(config, "icarus", "eskin_merge", merge.steps, tmp_path, 3)
    assert counts["transfers"] > 200
    assert counts["withheld"] > 200
    assert counts["resets"] == 12
