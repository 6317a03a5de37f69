"""Test inner validation, references and training on all recordings."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.app.commands.learn.options import Maker
from eskin.app.commands.signals.recordings import events_of
from eskin.model.config import ReadoutConfig
from eskin.skin.recordings.event_files import bin_of_spectrum
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.scans import ScanData
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.inner import FEW, choose
from eskin.snn.experiments.intervals import sentences
from eskin.snn.experiments.recipes import MOST_EPOCHS, epochs_for
from eskin.snn.experiments.settings import experiment_of
from eskin.snn.forest import forest_classes
from eskin.snn.reference import logistic_classes, references
from tests.skins import write_skin


def counted(each: int = 20) -> ScanData:
    """Return recordings of two classes that differ in their event rates."""
    generator, labels = np.random.default_rng(0), np.repeat([0, 1], each)
    values = generator.poisson(np.where(labels, 1.5, 0.5)[:, None, None], (2 * each, 30, 2)).astype(np.int16)
    names = tuple(f"{'ab'[label]}/{scan}" for scan, label in enumerate(labels))
    return ScanData(values, labels, np.arange(2 * each), names, ("a", "b"), 2, 0.03, 1.0)


def test_short_trainings_choose_what_learns() -> None:
    data, images = counted(), np.arange(3, 38)

    def experiment(**settings: Any) -> Experiment:
        return experiment_of("skin", {"hidden": 8, "batch": 4, **settings}, 16, BinConfig(), events="none")

    candidates = [experiment(learning_rate=1e-9), experiment(), experiment(learning_rate=1e-8)]
    lines: list[str] = []
    made, scores = choose(candidates, lambda _: data, images, 0, lines.append)
    assert made is candidates[1]
    assert [score["epochs"] for score in scores] == [2, 2, 2, 4, 4]
    assert len(lines) == len(scores)
    assert choose(candidates, lambda _: data, images, 0, lines.append)[1] == scores
    found, of_two = choose(candidates[:2], lambda _: data, images, 0, lines.append)
    assert (found, of_two) == (made, scores[:2]), "the last one is not trained again"
    few = np.array([0, 1, 20, 21])
    assert choose(candidates, lambda _: data, few, 0) == (candidates[0], []), "too few to set some apart"
    tests = dataclasses.replace(data, values=np.where(np.isin(np.arange(40), images)[:, None, None], data.values, 9))
    assert choose(candidates, lambda _: tests, images, 0)[1] == scores, "test recordings change nothing"


def test_small_data_get_as_many_updates() -> None:
    assert epochs_for(322, 4, 32, 2400) * np.ceil(322 * 4 / 32) == pytest.approx(2400, rel=0.05)
    assert epochs_for(75, 1, 9, 2400) == 267
    assert epochs_for(2, 1, 4, 2400) == MOST_EPOCHS


def test_time_bins_follow_the_spectrum() -> None:
    time_s = np.arange(600) / 1000
    for hz, bin_s in ((30, 8e-3), (60, 4e-3), (240, 1e-3)):
        values = 500 + 400 * np.sin(2 * np.pi * hz * time_s)[:, None] * [1, 1]
        assert bin_of_spectrum([values, values[:100]], 1000) == pytest.approx(bin_s, abs=1e-3)


def test_few_recordings_vary_bins_and_windows_and_others_bins_and_decays(folder: Path) -> None:
    write_skin(folder / "skin", rate_hz=500, taxels=4, each=2)
    place = events_of(Path("skin"), {"baseline": "first"}, ReadoutConfig(resolution=4), ("resolution", "encoding"))
    made = experiment_of("skin", {}, 60, BinConfig(bin_s=0.2), events=str(place))
    data = made.data()
    values: dict[str, Any] = {"data": Path("skin"), "recipe": None, "epochs": None, "settings": [], "bin_s": None}

    def varied(images: int, **given: Any) -> list[tuple[float, bool, int, int]]:
        some = np.resize(np.arange(len(data.names)), images)
        found = Maker(values | given).variations(made, data, some)
        return [
            (one.bins.bin_s, bool(one.network.get("learn_decay")), one.train.window_steps, one.train.windows)
            for one in found
        ]

    few = varied(6)
    bins = sorted({bin_s for bin_s, *_ in few})
    assert len(bins) == 3, "the default, and two from the spectrum"
    assert bins[1] == pytest.approx(2 * bins[0])
    assert {(steps, windows) for bin_s, _, steps, windows in few if bin_s == 0.2} == {(0, 1), (20, 2)}, "of 8 s"
    assert all(learned for _, learned, *_ in few)
    assert len(few) == 6
    many = varied(FEW + 1)
    assert len(many) == 6
    assert [learned for _, learned, *_ in many] == [False] * 3 + [True] * 3
    one_bin = dataclasses.replace(made, bins=BinConfig(bin_s=5))
    assert len(Maker(values | {"bin_s": 5.0}).variations(one_bin, data, np.arange(6))) == 1, "no half of one bin"
    assert varied(6, bin_s=0.2, settings=["window_steps=9", "learn_decay=false"]) == [(0.2, False, 9, 1)]


def test_a_forest_finds_classes_that_no_line_separates() -> None:
    generator = np.random.default_rng(1)
    columns = generator.uniform(-1, 1, (300, 4))
    labels = (columns[:, 0] * columns[:, 1] > 0).astype(np.int64)
    learned, test = np.arange(200), np.arange(200, 300)
    found = forest_classes(columns, labels, learned, test)
    assert (found == labels[test]).mean() > 0.85
    assert (logistic_classes(columns, labels, learned, test) == labels[test]).mean() < 0.7
    other = np.concatenate([labels[learned], 1 - labels[test]])
    assert np.array_equal(forest_classes(columns, other, learned, test), found), "test labels are not used"


def test_a_network_that_is_worse_than_a_reference_is_called_so() -> None:
    data, test = counted(), np.arange(0, 40, 2)
    found = references(data, np.arange(1, 40, 2), test, data.values.mean(1))
    assert list(found) == ["events", "signals", "forest", "most frequent class"]
    labels = data.image_labels[test]
    said = {"labels": labels.tolist(), "references": found, "predicted": labels.tolist()}
    assert len(sentences(said, False)) == 4
    worse = said | {"predicted": [0, 0, 0, 0, *labels[4:-6].tolist(), *[0] * 6]}
    assert sentences(worse, False)[-1].startswith("the network is worse than the logistic regression on statistics of")
    assert "; let networks of several --seed vote, or use that reference" in sentences(worse, False)[-1]
    once = said | {"predicted": [*labels[:-1].tolist(), 0]}
    assert len(sentences(once, False)) == 4, "one recording is within the interval"


@pytest.mark.usefixtures("shorter")
def test_the_delivered_network_can_be_trained_on_all_recordings(folder: Path, eskin: Any) -> None:
    write_skin(folder / "skin", taxels=4, each=6)
    given = "--encoding lcs --resolution 4 --baseline first --epochs 8 --set hidden=8"
    out, _ = eskin(*f"train --data skin --folds 2 --all {given}".split())
    assert out.count("inner validation: time bin ") == 0, "a fold of three recordings of a class is too small"
    assert "training on all 18 recordings" in out
    tested, whole = (json.loads(Path(f"out/train/{name}result.json").read_text()) for name in ("tested/", ""))
    assert len(tested["labels"]) == 9
    assert whole["tested_fold"] == {name: tested[name] for name in whole["tested_fold"] if name != "of"} | {"of": 9}
    assert whole["labels"] == []
    assert Path("out/train/weights.npz").read_bytes() != Path("out/train/tested/weights.npz").read_bytes()
    out, _ = eskin("predict", "out/train/weights.npz", "--data", "skin")
    assert "training recordings (used in the training: not a valid result): accuracy " in out
    assert "test recordings of the fold" not in out
    eskin("quantise", "out/train/weights.npz")
    _, error = eskin("quantise", "out/train/weights.npz", "--accuracy", "-o", "other.npz", code=2)
    assert "weights.npz was trained on all recordings, so --accuracy has no test recordings" in error


@pytest.mark.usefixtures("shorter")
def test_a_training_on_all_recordings_leaves_another_one_alone(folder: Path, eskin: Any) -> None:
    write_skin(folder / "skin", taxels=4, each=6)
    given = "train --data skin --folds 2 --encoding lcs --resolution 4 --baseline first --epochs 1 --set hidden=8"
    eskin(*given.split())
    before = Path("out/train/weights.npz").read_bytes()
    _, error = eskin(*f"{given} --all --out out/train".split(), code=2)
    assert "checkpoint out/train/checkpoint.pt belongs to another configuration (other images)" in error
    assert not Path("out/train/tested/checkpoint.pt").exists(), "refused before the first training"
    places = []
    for options in ("--seed 1", "--seed 1 --all"):
        out, error = eskin(*f"{given} {options}".split())
        places.append(out.split("weights: ")[-1].split("/weights.npz")[0])
        assert f"out/train holds another training; this one goes to {places[-1]}" in error
    assert len(set(places)) == 2
    assert Path(places[1], "tested", "result.json").exists()
    assert Path("out/train/weights.npz").read_bytes() == before
