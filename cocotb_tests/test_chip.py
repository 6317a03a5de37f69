"""Test the chip: its bins and rejected configurations; ``test_touch.py`` plays scans."""

import random
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from eskin.base.errors import InputError
from eskin.cocotb_tests.bench.block import Step
from eskin.cocotb_tests.blocks.classifier import loads, random_network
from eskin.cocotb_tests.runner.block import play_steps
from eskin.cocotb_tests.test_verilog import delivered
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.run import simulate
from eskin.model.config import ReadoutConfig


def chip(rows: int, columns: int, channels: int, hidden: int, margin: int = 0, **own: Any) -> ChipConfig:
    """Return a chip with the slowest possible clock, so that bursts must wait."""
    readout = ReadoutConfig(rows=rows, columns=columns, resolution=6, clocks_per_sample=64, **own)
    fields: dict[str, Any] = {"threshold": 200, "out_threshold": 200, "floor": -200, "out_floor": -200, "lanes": 4}
    fields |= {"bin_s": 0.0003, "reset": readout.reset, "margin": margin}
    network = ClassifierConfig(inputs=channels, hidden=hidden, classes=3, **fields)
    return ChipConfig(readout=readout, classifier=network)


CHIPS = [chip(3, 5, 30, 20, margin=3), chip(2, 4, 8, 24, encoding="nlcs", reset="async")]

SCANS = 12


def steps(config: ChipConfig, rng: random.Random, counts: Counter[str]) -> Iterator[Step]:
    """Yield scans without events that begin by a reset or by ``scan_start``, and the clocks with ``class_valid``."""
    network = random_network(config.classifier, rng)
    rest = {"rst": 1, "scan_start": 0, "load_valid": 0, "sample_valid": 0, "sample": 0, "taxel_enable": 0}
    yield from (Step(rest | inputs, {}) for inputs in loads(network, rng))
    width = config.classifier.clocks_per_bin
    for number in range(SCANS):
        yield Step({"scan_start": 1, "rst": 0} if number % 4 else {"rst": 1}, {})
        clocks = rng.randrange(4 * width)
        valid = set(simulate(network, [], range(width - 1, clocks, width), clocks).valid)
        for clock in range(clocks):
            yield Step({"rst": 0, "scan_start": 0}, {"class_valid": clock in valid}, f"clock {clock} of scan {number}")
            counts["classes after a scan_start"] += number % 4 > 0 and clock in valid


def test_a_scan_start_begins_the_bins_anew(tmp_path: Path) -> None:
    counts = play_steps(chip(2, 2, 8, 3, reset="async"), "icarus", "eskin_chip", steps, tmp_path, 7)
    assert counts["checks"] > 5 * SCANS
    assert counts["classes after a scan_start"] > 5


def test_a_chip_is_what_its_fields_say() -> None:
    for config in CHIPS:
        assert ChipConfig.from_dict(config.to_dict()) == config


def test_the_files_of_a_chip_are_clean_and_agree(tmp_path: Path) -> None:
    _, _, described = delivered(CHIPS[0], tmp_path)
    assert ChipConfig.from_dict(described["configuration"]) == CHIPS[0]
    assert described["clock_hz"] == CHIPS[0].readout.clock_hz
    widths = {port["name"]: port["width"] for port in described["ports"]}
    assert {name: width for name, width in widths.items() if width > 1} == {
        "taxel_enable": 15,
        "sample": 15 * 12,
        "load_address": 9,
        "load_data": 4 * 8,
        "event_channel": 5,
        "class_index": 2,
        "evidence": 3 * 24,
        "stall_count": 24,
        "hidden_index": 5,
        "hidden_potential": 24,
        "output_index": 2,
        "output_potential": 20,
    }
    assert {"sample_valid", "scan_start", "class_valid", "overrun"} < set(widths)
    assert not {"bin_end", "event_row"} & set(widths)


def test_a_chip_refuses_parts_that_do_not_fit() -> None:
    with pytest.raises(
        InputError, match="has 29 input channels, but 3 x 5 taxels of lcs have 15 or 30; give the readout"
    ):
        chip(3, 5, 29, 20)
    with pytest.raises(InputError, match="has 384 clocks, but its work needs 1505; raise --clocks-per-sample"):
        chip(3, 5, 30, 500)
    with pytest.raises(InputError, match="must have the link stream, not four_phase"):
        chip(3, 5, 30, 20, link="four_phase")
