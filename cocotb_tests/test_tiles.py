"""Compare a whole skin with its golden model: clock and address of every event."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from eskin.cocotb_tests.blocks.skin import play
from eskin.model.config import ReadoutConfig
from eskin.model.tiles.config import TilesConfig

if TYPE_CHECKING:
    from eskin.cocotb_tests.runner.cocotb_runners import Simulator


def skin(down: int, across: int, relays: int = 0, **tile: Any) -> TilesConfig:
    """Return a skin of tiles."""
    return TilesConfig.of(ReadoutConfig(**{"rows": 2, "columns": 2} | tile), down, across, relays)


CASES = [
    ("icarus", skin(1, 2)),
    ("icarus", skin(2, 2, rows=2, columns=3, encoding="nlcs", leak_period=3, reset="async")),
    ("icarus", skin(3, 1, rows=1, columns=1, encoding="cw-lcs", window_period=3)),
    ("icarus", skin(1, 3, relays=1, rows=1, columns=3)),
    ("icarus", skin(2, 1, relays=3, rows=3, columns=1, encoding="nlcs", reset="async")),
]


@pytest.mark.parametrize(
    ("simulator", "config"), CASES, ids=lambda v: f"{v.tiles}-{v.encoding}-{v.relays}" if v is not str(v) else v
)
def test_a_skin_equals_its_model(simulator: Simulator, config: TilesConfig, tmp_path: Path) -> None:
    counts = play(config, simulator, tmp_path)
    assert counts["tiles"] == config.tiles
    assert counts["events"] > 100
