"""Compare the relay station's RTL with a queue in every clock, with its contract, and with the golden model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from eskin.cocotb_tests.blocks.relay import play
from eskin.model.config import ReadoutConfig
from eskin.model.tiles.config import TilesConfig

if TYPE_CHECKING:
    from eskin.cocotb_tests.runner.cocotb_runners import Simulator


def skin(**tile: Any) -> TilesConfig:
    """Return a skin with relay stations."""
    return TilesConfig.of(ReadoutConfig(**{"rows": 2, "columns": 2} | tile), 1, 2, relays=1)


CASES = [
    ("icarus", skin()),
    ("icarus", skin(rows=1, columns=1, encoding="nlcs", reset="async")),
    ("icarus", skin(rows=3, columns=5, encoding="nlcs", reset="async")),
]


@pytest.mark.parametrize(
    ("simulator", "config"), CASES, ids=lambda v: f"{v.tile.event_bits}b-{v.reset}" if v is not str(v) else v
)
def test_relay_keeps_its_contract_and_equals_its_model(
    simulator: Simulator, config: TilesConfig, tmp_path: Path
) -> None:
    counts = play(config, simulator, tmp_path, seed=5)
    assert counts["transfers"] > 200
    assert counts["resets"] == 5
    assert counts["Event"] > counts["transfers"]  # some wait
    assert counts["left in the last run"] > 40
