"""Test the comparison of event counts of several readouts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.model.encoders import registry
from eskin.skin.textures.dataset import embedded_dataset
from eskin.snn.data.scans import ScanData, empty_bins, likeness

ENCODERS = ", ".join(registry.NAMES)


def scans(values: list[list[int]]) -> ScanData:
    found = np.array([values], np.int16)
    one = np.zeros(1, np.int64)
    return ScanData(found, one, one, ("a",), ("c",), 2, 0.004, 1.0)


def test_likeness_by_hand() -> None:
    nlcs = scans([[0, 1], [2, 0], [0, 3], [9, 9]])
    lcs = scans([[0, 1, 0, 1], [1, 0, 3, 0], [0, 6, 0, 0]])  # ON of both taxels, then OFF; a bin shorter
    assert empty_bins(lcs) == pytest.approx(7 / 12)
    assert likeness(nlcs, lcs) == {"correlation": pytest.approx(1.0), "ratio": 2.0}
    assert likeness(nlcs, scans([[1, 0], [0, 2], [3, 0]]))["correlation"] < 0


def test_the_command_writes_what_it_prints(call: Any, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eskin.snn.experiments.experiment.open_dataset", lambda _: embedded_dataset().limit(4))
    code, output, error = call("counts --preset physical --dataset embedded --points lcs:2,lcs:3,nlcs:4 --out c.json")
    assert code == 0, error
    found = json.loads((folder / "c.json").read_text())
    assert found["command"].startswith("eskin counts --points lcs:2,lcs:3,nlcs:4")
    assert found.keys() >= {"commit", "date"}
    assert found["empty"]["lcs:3"] < found["empty"]["lcs:2"]
    (one,) = found["pairs"]  # encoders are not mixed
    assert found["empty"]["nlcs:4"] > 0
    assert 0.5 < one["correlation"] < 1
    said = f"correlation of the counts {one['correlation']:.4f}, ratio {one['ratio']:.2f}"
    assert f"lcs:2 and lcs:3: {said}" in output


def test_frames_have_no_events_to_count(refuses: Any) -> None:
    refuses(f"error: --points takes event encoders ({ENCODERS}), not frame\n", "counts --points frame:250:8")
