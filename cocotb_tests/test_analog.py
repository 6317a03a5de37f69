"""Compare RTL and model for comparators with offset, noise, hysteresis and overdrive."""

from __future__ import annotations

from pathlib import Path

import pytest

from eskin.cocotb_tests.blocks.analog import CLOCKS, run
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
    counts = run(config, "icarus", "comparators_with_faults", tmp_path)
    assert counts["events"] > 300
    assert counts["random"] > CLOCKS
    assert counts["both"] > CLOCKS or not config.has_polarity
    if not config.encoder.late:
        assert counts["OnScale"] == 3 * config.taxels
        assert counts["ends"] > 20


def test_nothing_is_sent_for_ever_at_either_end(tmp_path: Path) -> None:
    assert run(BASE, "icarus", "one_code_over_the_ends", tmp_path)["NoneAtTheEnd"] == 2
