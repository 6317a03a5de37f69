"""Compare RTL and model for comparators with offset, noise, hysteresis and overdrive."""

from pathlib import Path

import pytest

from eskin.cocotb_tests.blocks.analog import CLOCKS, events_at, play_faults
from eskin.model.config import ReadoutConfig

BASE = ReadoutConfig(rows=2, columns=3, frontend="analog", resolution=3, window_period=2, leak_period=3, leak_shift=3)
CONFIGS = {
    "lcs-sample-24b": BASE.replace(decide_every="sample", sample_bits=24, resolution=2, reset="async"),
    "cw-lcs": BASE.replace(encoding="cw-lcs", link="four_phase"),
    "nlcs": BASE.replace(encoding="nlcs", resolution=2, leak_shift=6),
    "nlcs-bipolar": BASE.replace(encoding="nlcs-bipolar", resolution=2, leak_shift=6),
}


@pytest.mark.parametrize("name", CONFIGS)
def test_rtl_equals_the_model_that_is_given_the_decisions(name: str, tmp_path: Path) -> None:
    config = CONFIGS[name]
    counts = play_faults(config, "icarus", tmp_path)
    assert counts["events"] > 300
    assert counts["random"] > CLOCKS
    assert counts["both"] > CLOCKS or not config.has_polarity
    if not config.encoder.late:
        assert counts["ends"] > 20


def test_nothing_is_sent_for_ever_at_either_end(tmp_path: Path) -> None:
    high, step = BASE.full_scale, BASE.step
    for level, steps in ((high, high // step - 1), (-high - step - 1, high // step)):
        assert events_at(BASE, level, "icarus", tmp_path) == steps * BASE.taxels
