"""Compare a readout with registers with the golden model in every clock, under random host access."""

from pathlib import Path

import pytest

from eskin.cocotb_tests.bench.host import happens
from eskin.cocotb_tests.bench.stimuli import HOST
from eskin.cocotb_tests.blocks.host import play
from eskin.cocotb_tests.runner.process import play_runs, scenario_runs
from eskin.cocotb_tests.runner.simulator import build
from eskin.model.config import ReadoutConfig

BASE = ReadoutConfig(rows=3, columns=5, registers="spi")
CONFIGS = [
    BASE.replace(rows=9, columns=2, encoding="nlcs", leak_period=20, leak_shift=5),
    BASE.replace(encoding="nlcs", frontend="analog", rows=2, columns=2, leak_period=9, decide_every="sample"),
    BASE.replace(rows=1, columns=1, encoding="nlcs", leak_period=7, leak_shift=3),
    BASE.replace(
        rows=3, columns=6, receptive_fields="settable", encoding="nlcs-bipolar", leak_period=20, reset="async"
    ),
    BASE.replace(rows=4, columns=5, receptive_fields="settable", frontend="analog", link="four_phase_dual"),
    BASE.replace(rows=5, columns=9, encoding="cw-lcs", window_period=5, resolution=8),
]


def name(config: ReadoutConfig) -> str:
    return f"{config.rows}x{config.columns}-{config.encoding}-{config.frontend}-{config.receptive_fields}"


@pytest.mark.representative("9x2-nlcs-digital")
@pytest.mark.parametrize("config", CONFIGS, ids=name)
def test_readout_equals_the_model_while_a_host_sets_it(config: ReadoutConfig, tmp_path: Path) -> None:
    (run,) = (run for run in scenario_runs(config, 0, "") if run.name.startswith(HOST))
    assert run.host is not None
    assert play_runs(build(config, "icarus"), [run], tmp_path).events > 150
    assert run.host.run.miso.sum() > 50
    values = happens(run.host.run)
    assert values["mode"] == 3
    assert values["coarser"] > 1
    assert values["masks"] > 5
    assert values["fields"] == 4 * (config.receptive_fields == "settable")
    assert values["leak_period"] > 1 or not config.encoder.leaks
    assert values["leak_shift"] > 1 or not config.encoder.leaks
    assert values["window_period"] > 1 or not config.closes


def test_block_bench_of_the_coverage_follows_the_model_too(tmp_path: Path) -> None:
    config = CONFIGS[1].replace(receptive_fields="settable")
    counts, values = play(config, "icarus", tmp_path, seed=21)
    assert counts["events"] == values["events"] > 200
    assert counts["ones read"] > 50
    assert values["fields"] > 1
