"""Test the data rates of events and frames on equal scans."""

from __future__ import annotations

import pytest

from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.frame_config import FrameConfig
from eskin.skin.textures.dataset import embedded_dataset
from eskin.skin.textures.physical import PhysicalScan
from eskin.skin.textures.rates import measure_rates
from eskin.skin.textures.traffic import compare_traffic


def test_every_readout_sends_the_bits_of_its_own_rate() -> None:
    textures, scan = embedded_dataset().limit(1), PhysicalScan()
    config = ReadoutConfig(rows=2, columns=2, resolution=4)
    frame = FrameConfig(readout=config)
    found = compare_traffic(textures, scan, config, frame)
    assert found["frame"]["bits_per_s"] == pytest.approx(4 * 4 * frame.frame_rate_hz)  # 4 taxels of 4 bits
    for encoder in registry.ENCODERS:
        rate_hz = measure_rates(textures, scan, scan.configure(config.replace(encoding=encoder.name), None))
        sent = found[encoder.name]
        assert sent["events_per_s"] == pytest.approx(rate_hz.population_rate_hz) != 0
        assert sent["bits_per_event"] == 2 + encoder.polarity  # row, column
        assert sent["bits_per_s"] == pytest.approx(sent["events_per_s"] * sent["bits_per_event"])
        assert sent["equal_frame_rate_hz"] == pytest.approx(sent["bits_per_s"] / 16)
