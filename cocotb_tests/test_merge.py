"""Compare the merge's RTL with a queue in every clock, with its contract, and with the golden model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from eskin.cocotb_tests.blocks.merge import play
from eskin.model.config import ReadoutConfig
from eskin.model.tiles.config import TilesConfig

if TYPE_CHECKING:
    from eskin.cocotb_tests.runner.cocotb_runners import Simulator


def skin(down: int, across: int, **tile: Any) -> TilesConfig:
    """Return a skin of tiles."""
    return TilesConfig.of(ReadoutConfig(**{"rows": 2, "columns": 2} | tile), down, across)


CASES = [
    ("icarus", skin(1, 2)),
    ("icarus", skin(1, 1, reset="async")),
    ("icarus", skin(1, 3, rows=1, columns=1, encoding="nlcs", reset="async")),
    ("icarus", skin(4, 4, rows=64, columns=64)),
]


@pytest.mark.parametrize(
    ("simulator", "config"), CASES, ids=lambda value: f"{value.tiles}" if isinstance(value, TilesConfig) else value
)
def test_merge_keeps_its_contract_and_equals_its_models(
    simulator: Simulator, config: TilesConfig, tmp_path: Path
) -> None:
    counts = play(config, simulator, tmp_path, seed=3)
    assert counts["transfers"] > 200
    assert counts["resets"] >= 5
    assert counts["Event"] >= counts["transfers"]
    assert counts["left in the last run"] > 40
