"""Compare the frame readout's RTL with the model in every clock, for all kinds of ADCs and receivers."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.cocotb_tests.bench.frame import SarAdc
from eskin.cocotb_tests.bench.textures import random_scan, scan
from eskin.cocotb_tests.blocks.frame import cosimulate, scanned_frames
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.frame_words import adc_code

PROPERTIES = (
    "OneTaxelSelected",
    "MultiplexerSettled",
    "SelectedWhileConverting",
    "WordStableUntilTaken",
    "EveryTaxelInOrder",
    "EverySampleOnceInOrder",
)


def frame_config(rows: int, columns: int, resolution: int, reset: str = "sync", **own: Any) -> FrameConfig:
    """Return a frame readout configuration."""
    shared = {"rows": rows, "columns": columns, "resolution": resolution, "reset": reset}
    return FrameConfig.from_dict(shared | own)


CONFIGS = [
    frame_config(1, 1, 1),
    frame_config(1, 1, 10, "async"),
    frame_config(1, 4, 6),
    frame_config(3, 5, 1, "async"),
    frame_config(3, 5, 10),
    frame_config(8, 8, 6, "async"),
    frame_config(3, 5, 6, word_bits=6),  # a code is a word
    frame_config(2, 3, 5, word_bits=10, settle_clocks=3),  # half a word
    frame_config(4, 1, 22, "async", word_bits=23, sample_bits=24, settle_clocks=2),
    frame_config(1, 3, 6, word_bits=64),  # a frame is less than a word
]


def name(config: FrameConfig) -> str:
    """Return the name of a configuration in the list of tests."""
    return f"{config.rows}x{config.columns}-{config.resolution}b-{config.word_bits}b-{config.reset}"


@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: f"icarus-{name(config)}")
def test_rtl_equals_the_model_in_every_clock_and_loses_no_sample(config: FrameConfig, tmp_path: Path) -> None:
    texture = random_scan(config.readout, 400, np.random.default_rng(config.taxels))
    counts = cosimulate(config, "icarus", "frames_equal_the_model", tmp_path, config.taxels, texture)
    assert counts["checks"] > 4000
    assert counts["words"] > 0
    assert counts["words"] == counts["frames"] * config.words_per_frame
    assert counts["frames"] >= 4
    assert counts["overruns"] > 10
    assert counts["resets"] > 4
    assert counts["frames begun after reset"] > 3
    assert all(counts[property_name] > 0 for property_name in PROPERTIES), counts


@pytest.mark.parametrize(
    "config",
    [frame_config(8, 8, 6), frame_config(3, 5, 10, "async"), frame_config(1, 1, 6), frame_config(12, 16, 8)],
    ids=name,
)
def test_texture_scan_leaves_as_the_words_of_the_model(config: FrameConfig, tmp_path: Path) -> None:
    samples = scan(config.rows, config.columns, config.sample_bits, 11)[::100][: scanned_frames(config)].astype(
        np.int64
    )
    counts = cosimulate(config, "icarus", "texture_scan_gives_its_codes", tmp_path, 1, samples)
    assert counts["frames"] == scanned_frames(config)
    assert counts["words"] == counts["frames"] * config.words_per_frame
    assert counts["different codes"] > 3
    assert counts["overruns"] == 0


def test_sar_of_the_bench_rounds_down_over_the_whole_range() -> None:
    for resolution in (1, 4, 6):
        config = FrameConfig(readout=ReadoutConfig(sample_bits=8, resolution=resolution))
        adc = SarAdc(config, "fixed", random.Random(0))
        samples = np.arange(-128, 128)
        codes = np.array([adc.convert(int(sample)) for sample in samples])
        assert np.array_equal(codes, adc_code(config, samples) & ((1 << resolution) - 1))
