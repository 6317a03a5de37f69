"""Test the chip: its bins and rejected configurations; ``test_touch.py`` plays scans."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cocotb
import pytest

from eskin.base.errors import InputError
from eskin.cocotb_tests.bench.block import Block, Checker, job, report
from eskin.cocotb_tests.bench.classifier import load_words
from eskin.cocotb_tests.blocks.classifier import random_network
from eskin.cocotb_tests.runner.block import cosimulate
from eskin.cocotb_tests.test_verilog import delivered
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.run import simulate
from eskin.model.config import ReadoutConfig


def chip(rows: int, columns: int, channels: int, hidden: int, **own: Any) -> ChipConfig:
    """Return a chip with the slowest possible clock, so that bursts must wait."""
    readout = ReadoutConfig(rows=rows, columns=columns, resolution=6, clocks_per_sample=64, **own)
    fields: dict[str, Any] = {"threshold": 200, "out_threshold": 200, "floor": -200, "out_floor": -200, "lanes": 4}
    network = ClassifierConfig(inputs=channels, hidden=hidden, classes=3, bin_s=0.0003, reset=readout.reset, **fields)
    return ChipConfig(readout=readout, classifier=network)


CHIPS = [chip(3, 5, 30, 20), chip(2, 4, 8, 24, encoding="nlcs", reset="async")]

SCANS = 12


@cocotb.test()
async def bins_begin_anew(dut: Any) -> None:
    """Start scans without events by a reset or by ``scan_start``, and record the clocks with ``class_valid``."""
    config, rng = job(ChipConfig.from_dict)
    block = Block(dut)
    check = Checker(block)
    block.drive(rst=1, scan_start=0, load_valid=0, sample_valid=0, sample=0, taxel_enable=0)
    network = random_network(config.classifier, rng)
    await load_words(block, network, rng)
    width = config.classifier.clocks_per_bin
    for number in range(SCANS):
        if number % 4:
            block.drive(scan_start=1)
            await block.edge()
            block.drive(scan_start=0)
        else:
            await block.reset()
        clocks, seen = rng.randrange(4 * width), []
        for clock in range(clocks):
            await block.settle()
            if block.read("class_valid"):
                seen.append(clock)
            await block.edge()
        run = simulate(network, [], range(width - 1, clocks, width), clocks)
        expected = [clock for clock in run.valid if clock < clocks]
        check.holds("ClassesAfterTheirBins", seen == expected, (seen, expected))
        check.counts["classes after a scan_start"] += len(seen) if number % 4 else 0
    report(check.counts)


def test_a_scan_start_begins_the_bins_anew(tmp_path: Path) -> None:
    config = chip(2, 2, 8, 3, reset="async")
    module = "eskin.cocotb_tests.test_chip"
    counts = cosimulate(config, "icarus", "eskin_chip", "bins_begin_anew", tmp_path, 7, module)
    assert counts["ClassesAfterTheirBins"] == SCANS
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


def test_what_does_not_fit_is_refused_in_one_sentence() -> None:
    with pytest.raises(
        InputError, match="has 29 input channels, but 3 x 5 taxels of lcs have 15 or 30; give the readout"
    ):
        chip(3, 5, 29, 20)
    with pytest.raises(InputError, match="has 384 clocks, but its work needs 1505; raise --clocks-per-sample"):
        chip(3, 5, 30, 500)
    with pytest.raises(InputError, match="must have the link stream, not four_phase"):
        chip(3, 5, 30, 20, link="four_phase")
