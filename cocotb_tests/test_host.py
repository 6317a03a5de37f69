"""Compare a readout with registers with the golden model in every clock, under random host access."""

from pathlib import Path

import pytest

from eskin.cocotb_tests.blocks.host import play
from eskin.model.config import ReadoutConfig

BASE = ReadoutConfig(rows=3, columns=5, registers="spi")
CONFIGS = [
    BASE.replace(encoding="nlcs", leak_period=20, leak_shift=5),
    BASE.replace(encoding="nlcs", frontend="analog", rows=2, columns=2, leak_period=9, decide_every="sample"),
    BASE.replace(rows=1, columns=1, encoding="nlcs", leak_period=7, leak_shift=3),
    BASE.replace(
        rows=3, columns=6, receptive_fields="settable", encoding="nlcs-bipolar", leak_period=20, reset="async"
    ),
    BASE.replace(rows=4, columns=5, receptive_fields="settable", frontend="analog"),
    BASE.replace(rows=5, columns=9, encoding="cw-lcs", window_period=5, resolution=8),
]


def name(config: ReadoutConfig) -> str:
    return f"{config.rows}x{config.columns}-{config.encoding}-{config.frontend}-{config.receptive_fields}"


@pytest.mark.representative("3x5-nlcs-digital")
@pytest.mark.parametrize("config", CONFIGS, ids=name)
def test_readout_equals_the_model_while_a_host_sets_it(config: ReadoutConfig, tmp_path: Path) -> None:
    counts, happens = play(config, "icarus", tmp_path, seed=21)
    assert counts["events"] == happens["events"] > 200
    assert counts["ones read"] > 50
    assert happens["mode"] == 3
    assert happens["coarser"] > 1
    assert happens["masks"] > 5
    assert happens["fields"] == 4 * (config.receptive_fields == "settable")
    assert happens["leak_period"] > 1 or not config.encoder.leaks
    assert happens["leak_shift"] > 1 or not config.encoder.leaks
    assert happens["window_period"] > 1 or not config.closes
