"""Test the study of slow signals: SNR and data rate of encoders and of uniform sampling."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.model.encoders import registry
from studies import slow_signals as slow_signals_study
from studies.slow_signals import SAMPLE_BITS, slow_signals, study_data, uniform
from tests.skins import write_skin


@pytest.fixture(scope="module")
def points() -> dict[tuple[str, int], dict[str, Any]]:
    return {(point["encoding"], point["resolution"]): point for point in study_data()["points"]}


def test_lcs_gains_six_decibels_and_a_factor_of_two_a_bit(points):
    for resolution in range(3, 8):
        fine, coarse = points["lcs", resolution], points["lcs", resolution - 1]
        assert 4.5 < fine["snr_db"] - coarse["snr_db"] < 7.5
        assert 1.8 < fine["data_rate_bps"] / coarse["data_rate_bps"] < 2.4


def test_nothing_is_late_and_every_point_has_its_equal_of_uniform_sampling(points):
    assert len(points) == 9 * len(registry.NAMES)
    for (encoding, _), point in points.items():
        assert (point["late"], point["merged"]) == (0, 0)
        assert point["data_rate_bps"] == point["events_per_s"] * (4 + registry.named(encoding).polarity)  # 4 x 4 taxels
        same = point["uniform"]
        assert 16 * same["bits"] * same["frame_rate_hz"] <= point["data_rate_bps"] * (1 + 1e-9)
        assert same["frame_rate_hz"] <= 100
        assert math.isfinite(same["snr_db"])


def test_uniform_sampling_is_what_a_loop_over_samples_gives():
    codes = slow_signals()[2][:200]
    found = uniform([codes], 16 * 6 * 25.0, 100.0, SAMPLE_BITS)
    bits, every = found["bits"], 100 / found["frame_rate_hz"]
    held, noise, due = None, 0.0, 0.0
    for tick, row in enumerate(codes.tolist()):
        if tick >= due - 1e-6:
            step = 2 ** (SAMPLE_BITS - bits)
            held = [min(round(x / step), 2 ** (bits - 1) - 1) * step for x in row]
            due += every
        noise += sum((x - y) ** 2 for x, y in zip(row, held, strict=True))
    signal = float(((codes - codes.mean(0)) ** 2).sum())
    assert found["snr_db"] == pytest.approx(10 * math.log10(signal / noise), abs=0.01)


def test_the_study_of_own_recordings_writes_data_and_picture(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_skin(folder / "skin", taxels=4, each=1)
    monkeypatch.setattr(slow_signals_study, "RESOLUTIONS", (3, 6))
    monkeypatch.setattr(slow_signals_study, "RECORDINGS", folder / "skin")
    path, figure = slow_signals_study.RESULT.make("slow_signals", folder)
    data = json.loads(path.read_text())
    assert {name: data[name] for name in ("source", "recordings", "rows", "columns")} == {
        "source": "skin",
        "recordings": 3,
        "rows": 2,
        "columns": 2,
    }
    assert data["rate_hz"] == pytest.approx(35)
    assert len(data["points"]) == 2 * len(registry.NAMES)
    assert figure.stat().st_size > 20_000
    assert np.isfinite([point["snr_db"] for point in data["points"]]).all()
