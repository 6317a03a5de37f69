"""Test trainings on recordings at other gains."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.app.commands.signals.recordings import events_of
from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.skin.recordings.folder import read_set
from eskin.skin.recordings.options import Baseline, Preparation, scale_option
from eskin.skin.recordings.prepare import at_gain, levels_of
from eskin.snn import encoder_choice
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.gains import GAINS, binned, with_gains
from eskin.snn.data.scans import load_recordings
from eskin.snn.encoder_choice import EncoderChoice
from eskin.snn.experiments import inner
from tests.skins import write_csv

pytestmark = pytest.mark.usefixtures("shorter")


def levels(force: float, slope: float, number: int) -> np.ndarray[Any, Any]:
    """Return raw counts of two taxels whose ratio is the class, times the force of the touch."""
    random, time_s = np.random.default_rng(number), np.arange(60) / 35
    shape = 100 * (1 - np.exp(-time_s / 0.2))[:, None] * [1, slope]
    return np.rint(30 + force * shape + random.normal(0, 2, shape.shape)).astype(np.int64)


def write_forces(folder: Path, forces: tuple[float, ...], each: int = 2) -> None:
    for kind, slope in (("flat", 1.0), ("edge", 1.6)):
        for force in forces:
            for number in range(each):
                values = levels(force, slope, number + round(100 * force))
                write_csv(folder / f"{kind}/F{force:g}_{number}.csv", values)


@pytest.mark.parametrize("baseline", ["fixed", "first", "median", "none", "highpass"])
def test_codes_at_a_gain_are_those_of_larger_signals(folder: Path, baseline: Baseline) -> None:
    write_forces(folder / "skin", (1.0, 1.5), each=1)
    options = Preparation(baseline=baseline, scale=scale_option((1 / 400, 1 / 700)), offsets=(40.5, 31.0))
    config = ReadoutConfig(sample_bits=14)
    before = read_set(Path("skin"), options, config)
    for path in sorted(Path("skin").rglob("*.csv")):
        write_csv(path, np.loadtxt(path, delimiter=",", skiprows=1)[:, 1:] * 1.4)
    after = read_set(Path("skin"), options, config)
    level = levels_of(before.options, before.scale, 14, 2)
    for codes, larger in zip(before.codes, after.codes, strict=True):
        assert np.abs(at_gain(codes, 1.4, level, 14) - larger).max() <= 1, "the rounding of both"
        assert np.abs(codes - larger).max() > 50


def test_scans_at_other_gains_follow_those_that_are_tested(folder: Path) -> None:
    write_forces(folder / "skin", (1.0, 1.5))
    bins, config = BinConfig(bin_s=1 / 35), ReadoutConfig(resolution=5)
    place = events_of(Path("skin"), {"baseline": "fixed", "gains": (0.5, 1.0)}, config, ("resolution", "baseline"))
    plain = load_recordings(place, bins)
    data = with_gains(plain, place, bins)
    number = len(plain.names)
    assert len(data) == 3 * number
    assert np.array_equal(data.values[:number], plain.values)
    assert np.array_equal(data.first_scans(range(number)), np.arange(number))
    assert data.labels.tolist() == data.image_labels[data.images].tolist()
    softer, same = data.values[number : 2 * number], data.values[2 * number :]
    assert np.array_equal(same, plain.values), "every event leaves within its sample"
    assert 0 < softer.sum() < 0.8 * same.sum()
    none = events_of(Path("skin"), {"baseline": "fixed"}, config, ("resolution", "baseline"))
    assert with_gains(plain, none, bins) is plain


def test_offset_and_scale_have_room_for_the_gains(folder: Path) -> None:
    write_forces(folder / "skin", (1.0, 1.5))
    paths = sorted(Path("skin").rglob("*.csv"))
    raw = np.concatenate([np.loadtxt(path, delimiter=",", skiprows=1)[:, 1:] for path in paths])
    larger = np.concatenate([raw * gain for gain in (1, *GAINS)])
    baselines: tuple[Baseline, ...] = ("first", "fixed")
    for baseline in baselines:
        plain = Preparation(baseline=baseline)
        narrow = read_set(Path("skin"), plain, ReadoutConfig())
        wide = read_set(Path("skin"), dataclasses.replace(plain, gains=GAINS), ReadoutConfig())
        assert isinstance(wide.scale, float)
        assert isinstance(narrow.scale, float)
        assert wide.scale < 0.75 * narrow.scale
        if baseline == "fixed":
            assert wide.options.offsets == pytest.approx(np.percentile(larger, 1, axis=0))
        level = levels_of(wide.options, wide.scale, 12, 2)
        assert max(int(at_gain(codes, 1.4, level, 12).max()) for codes in wide.codes) in range(2030, 2048)


def test_a_first_and_a_last_part_of_a_bin_are_left_out() -> None:
    config = ReadoutConfig(rows=1, columns=1, sample_rate_hz=100, resolution=4)
    codes = 300 * np.arange(7, dtype=np.int32)[:, None] - 1000
    whole = binned(config, codes, BinConfig(bin_s=0.01))
    assert whole.shape == (7, 2)
    assert np.array_equal(binned(config, codes, BinConfig(bin_s=0.03))[:, 0], whole[:6, 0].reshape(2, 3).sum(1))
    later = BinConfig(bin_s=0.02, start_s=0.01, stop_s=0.05)
    assert np.array_equal(binned(config, codes, later)[:, 0], whole[1:5, 0].reshape(2, 2).sum(1))


def test_groups_are_compared_with_and_without_gains(folder: Path) -> None:
    write_forces(folder / "skin", (0.6, 0.8, 1.0, 1.2, 1.5), each=2)
    fit, config = EncoderChoice(test="*/F1.5_*"), ReadoutConfig(resolution=4)
    grouped = Preparation(baseline="first", group_name="F[0-9.]+")
    fixed = ("encoding", "resolution", "baseline")
    found = read_set(Path("skin"), grouped, config, fixed, fit=fit)
    assert {tuple(one.get("gains", ())) for one in found.scores} == {(), GAINS}
    assert all(one["of"] == 12 for one in found.scores), "three of the four groups are the inner validation once"
    alone = read_set(Path("skin"), grouped, config, (*fixed, "gains"), fit=fit)
    assert not alone.scores, "nothing is left to compare"
    assert alone.options == dataclasses.replace(found.options, gains=())


@pytest.mark.parametrize(("each", "folds", "of"), [(3, 6, [6, 6, 6]), (4, 4, [7, 8, 8])])
def test_few_recordings_compare_gains_by_the_last_and_longest_trainings(
    folder: Path, monkeypatch: pytest.MonkeyPatch, each: int, folds: int, of: list[int]
) -> None:
    write_forces(folder / "skin", (0.8, 1.2), each=each)
    monkeypatch.setattr(encoder_choice, "FEW", 50)
    monkeypatch.setattr(inner, "FEW", 50)
    monkeypatch.setattr(encoder_choice, "LONG", 40)
    options, config = Preparation(baseline="first"), ReadoutConfig(resolution=4)
    found = read_set(
        Path("skin"), options, config, ("encoding", "resolution", "baseline"), fit=EncoderChoice(folds=folds)
    )
    assert [one["updates"] for one in found.scores] == [encoder_choice.UPDATES[-1], 40, 40]
    assert [tuple(one.get("gains", ())) for one in found.scores] == [(), (), GAINS]
    assert [one["of"] for one in found.scores] == of, "three of the five parts"
    better = min(found.scores[1:], key=lambda one: float(one["log_loss"]))
    assert found.options.gains == tuple(better.get("gains", ()))
    assert any(f"the class of {better['right']} of {better['of']} other recordings" in note for note in found.notes)


def test_gains_that_are_none_are_refused(folder: Path, refuses: Any) -> None:
    write_forces(folder / "skin", (1.0, 1.5))
    refuses("--gains needs numbers such as 0.7,1.4, or none", "train", "--data", "skin", "--gains", "loud")
    refuses("--gains needs your own recordings; name their folder with --data DIR", "train", "--gains", "0.7")
    with pytest.raises(InputError, match=r"--gains needs positive numbers such as 0\.7,1\.4, not \(0\.5, -1\)"):
        Preparation(gains=(0.5, -1))
