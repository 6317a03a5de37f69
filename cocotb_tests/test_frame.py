"""Compare the frame readout's RTL with the model in every clock, for all kinds of ADCs and receivers."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.cocotb_tests.bench.textures import random_scan
from eskin.cocotb_tests.blocks.frame import play
from eskin.model.frame_config import FrameConfig


def frame_config(rows: int, columns: int, resolution: int, reset: str = "sync", **own: Any) -> FrameConfig:
    """Return a frame readout configuration."""
    shared = {"rows": rows, "columns": columns, "resolution": resolution, "reset": reset}
    return FrameConfig.from_dict(shared | own)


CONFIGS = [
    frame_config(1, 1, 1),
    frame_config(1, 4, 6),
    frame_config(3, 5, 10),
    frame_config(3, 5, 6, word_bits=6),  # a code is a word
    frame_config(2, 3, 5, word_bits=10, settle_clocks=3),  # half a word
    frame_config(4, 1, 22, "async", word_bits=23, sample_bits=24, settle_clocks=2),
    frame_config(1, 3, 6, word_bits=64),  # a frame is less than a word
    frame_config(8, 13, 8),
]


def name(config: FrameConfig) -> str:
    """Return the name of a configuration in the list of tests."""
    return f"{config.rows}x{config.columns}-{config.resolution}b-{config.word_bits}b-{config.reset}"


@pytest.mark.representative("icarus-1x4-6b", "icarus-2x3-5b", "icarus-3x5-6b-6b", block="frame")
@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: f"icarus-{name(config)}")
def test_rtl_equals_the_model_in_every_clock_and_loses_no_sample(config: FrameConfig, tmp_path: Path) -> None:
    texture = random_scan(config.readout, 400, np.random.default_rng(config.taxels))
    counts = play(config, "icarus", tmp_path, config.taxels, texture)
    assert counts["checks"] > 4000
    assert counts["words"] > 0
    assert counts["words"] == counts["frames"] * config.words_per_frame
    assert counts["frames"] >= 4
    assert counts["overruns"] > 10
    assert counts["resets"] > 4
    assert counts["frames begun after reset"] > 3
