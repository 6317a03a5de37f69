"""Compare a whole skin with its golden model: clock and address of every event."""

from pathlib import Path
from typing import Any

import pytest

from eskin.cocotb_tests.blocks.skin import steps
from eskin.cocotb_tests.runner.block import play_steps
from eskin.model.config import ReadoutConfig
from eskin.model.tiles.config import TilesConfig


def skin(down: int, across: int, relays: int = 0, **tile: Any) -> TilesConfig:
    """Return a skin of tiles."""
    return TilesConfig.of(ReadoutConfig(**{"rows": 2, "columns": 2} | tile), down, across, relays)


CONFIGS = [
    skin(1, 2),
    skin(2, 2, rows=2, columns=3, encoding="nlcs", leak_period=3, reset="async"),
    skin(3, 1, rows=1, columns=1, encoding="cw-lcs", window_period=3),
    skin(1, 3, relays=1, rows=1, columns=3),
    skin(2, 1, relays=3, rows=3, columns=1, encoding="nlcs", reset="async"),
]


@pytest.mark.representative("icarus-4-nlcs")
@pytest.mark.parametrize("config", CONFIGS, ids=lambda c: f"icarus-{c.tiles}-{c.encoding}-{c.relays}")
def test_a_skin_equals_its_model(config: TilesConfig, tmp_path: Path) -> None:
    counts = play_steps(config, "icarus", "eskin_tiles", steps, tmp_path, 0)
    assert counts["tiles"] == config.tiles
    assert counts["events"] > 100
