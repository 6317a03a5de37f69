"""The chip as it is delivered, and what it refuses; ``test_touch.py`` plays scans through it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from cocotb_tests.test_verilog import lint
from model.classifier.chip_config import ChipConfig
from model.classifier.config import ClassifierConfig
from model.config import ReadoutConfig
from model.errors import InputError
from rtl.delivery import write


def chip(rows: int, columns: int, channels: int, hidden: int, **own: Any) -> ChipConfig:
    """Return a chip whose clock is as slow as the network allows, so that bursts must wait."""
    readout = ReadoutConfig(rows=rows, columns=columns, resolution=6, clocks_per_sample=64, **own)
    fields: dict[str, Any] = {
        "threshold": 200,
        "out_threshold": 200,
        "floor": -200,
        "out_floor": -200,
        "lanes": 4,
        "bin_s": 0.0003,
    }
    network = ClassifierConfig(inputs=channels, hidden=hidden, classes=3, reset=readout.reset, **fields)
    return ChipConfig(readout=readout, classifier=network)


CHIPS = [chip(3, 5, 30, 20), chip(2, 4, 8, 24, encoding="nlcs", reset="async")]


def test_a_chip_is_what_its_fields_say() -> None:
    for config in CHIPS:
        assert ChipConfig.from_dict(config.to_dict()) == config


def test_the_files_of_a_chip_are_clean_and_agree(tmp_path: Path) -> None:
    paths = write(CHIPS[0], tmp_path)
    assert [path.name for path in paths] == [f"eskin_chip.{suffix}" for suffix in ("v", "sdc", "json", "core")]
    assert lint(paths[0]) == ""
    described = json.loads(paths[2].read_text())
    assert ChipConfig.from_dict(described["configuration"]) == CHIPS[0]
    assert described["clock_hz"] == CHIPS[0].readout.clock_hz
    names = {port["name"] for port in described["ports"]}
    assert {"sample", "taxel_enable", "event_channel", "class_index", "load_data"} <= names
    assert not {"bin_end", "event_row"} & names


def test_what_does_not_fit_is_refused_in_one_sentence() -> None:
    with pytest.raises(InputError, match="takes 29 channels, 3 x 5 taxels of lcs have 15 or 30; give the readout"):
        chip(3, 5, 29, 20)
    with pytest.raises(InputError, match="has 384 clocks, its work takes 1505; raise --clocks-per-sample"):
        chip(3, 5, 30, 500)
    with pytest.raises(InputError, match="link stream within, not four_phase"):
        chip(3, 5, 30, 20, link="four_phase")
