"""Test the study of the slides of a BioTac on generated files of its form."""

from pathlib import Path

import numpy as np
import pytest

from eskin.snn.experiments.single import Fold
from studies import biotac


@pytest.fixture
def slides(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write four slides over each of two materials, whose levels differ; the electrodes are the last 19 columns."""
    monkeypatch.chdir(folder)
    random = np.random.default_rng(0)
    names = ["timestamp", *(f"p{column}" for column in range(25)), *(f"ele{column}" for column in range(1, 20))]
    for material, level in (("mat1", 100), ("mat2", 300)):
        (folder / "raw" / material).mkdir(parents=True)
        for number in (1, 4, 39, 45):
            time_s = np.arange(100) / 100
            rows = random.normal(level, 20, (100, 45)).cumsum(0) / 50
            rows[:, 0], rows[:, 1:26] = time_s, 1e6
            path = folder / "raw" / material / f"{material}_{number}_bio.csv"
            np.savetxt(path, rows, "%.4f", ",", header=",".join(names), comments="")
    return folder / "raw"


def test_readouts_see_the_electrodes_and_are_nearest_to_the_data_rates(
    slides: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rates = {"nlcs": 4, "lcs": 30, "cw-lcs": 1e-9, "nlcs-bipolar": 10}
    monkeypatch.setattr(biotac, "rate_of", lambda config, _: rates[config.encoding] * 2.0**config.resolution)
    found = biotac.readouts_of("first", slides)
    assert {budget: [one.text for one in own] for budget, own in found.items()} == {
        1000: ["nlcs:8", "lcs:5", "cw-lcs:2", "nlcs-bipolar:7"],  # equally far from all: the first
        3000: ["nlcs:10", "lcs:7", "cw-lcs:2", "nlcs-bipolar:8"],
    }
    experiment = found[1000][0].experiment(slides)
    data = experiment.data()
    assert data.channels == 19
    tested = Fold.named(data, *experiment.tests).test
    assert [data.names[number] for number in tested] == ["mat1/mat1_45_bio", "mat2/mat2_45_bio"]
    assert {one.baseline for one in found[3000][0].frames(1000.0)} == {"first"}
