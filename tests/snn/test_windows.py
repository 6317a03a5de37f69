"""Test training on recordings of different lengths, with windows and class weights."""

import dataclasses

import numpy as np
import pytest
import torch

from eskin.base.errors import InputError
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.scans import ScanData, Split
from eskin.snn.experiments.recipes import for_recordings
from eskin.snn.experiments.settings import experiment_of
from eskin.snn.experiments.single import Fold
from eskin.snn.network_config import NetworkConfig
from eskin.snn.reference import references
from eskin.snn.train import _class_weights, logits_of, predicted_classes, train
from eskin.snn.training import TrainConfig

LENGTHS = np.array([30, 200, 60, 120, 45, 300] * 4)
LABELS = np.array([0] * 18 + [1] * 6)


def recordings() -> ScanData:
    """Return padded recordings of 30 to 300 steps with unbalanced classes."""
    generator = np.random.default_rng(0)
    values = np.zeros((24, 300, 2), np.int16)
    for scan, (length, label) in enumerate(zip(LENGTHS, LABELS, strict=True)):
        values[scan, :length] = generator.poisson((1.2, 0.4) if label == 0 else (0.4, 1.2), (length, 2))
    names = tuple(f"{'ab'[label]}/{scan % 2}_{scan}" for scan, label in enumerate(LABELS))
    return ScanData(values, LABELS, np.arange(24), names, ("a", "b"), 2, 0.03, 1.0, lengths=LENGTHS)


def test_a_window_lies_within_its_recording_and_differs_every_time() -> None:
    data, generator = recordings(), np.random.default_rng(1)
    marked = dataclasses.replace(
        data, values=np.broadcast_to(np.arange(300)[None, :, None] < LENGTHS[:, None, None], (24, 300, 2))
    )
    windows = marked.windows(np.arange(24), 40, generator)
    assert windows.shape == (40, 24, 2)
    assert windows.sum((0, 2)).tolist() == [2.0 * min(length, 40) for length in LENGTHS]
    numbered = dataclasses.replace(data, values=np.tile(np.arange(300)[None, :, None], (24, 1, 2)))
    begins = [int(numbered.windows([5], 40, generator)[0, 0, 0]) for _ in range(50)]
    assert len(set(begins)) > 25
    assert max(begins) <= 260


def test_padding_of_a_recording_does_not_change_its_logits() -> None:
    data = recordings()
    fields = {"inputs": 2, "classes": 2, "hidden": 8, "readout": "membrane", "output_decay": 0.9}
    found = train(Split(data, np.arange(24)), NetworkConfig.from_dict(fields), TrainConfig(epochs=1), 0)
    logits = logits_of(found.network, data)
    alone = dataclasses.replace(data, values=data.values[[4], :45], labels=LABELS[[4]], images=np.array([0]))
    alone = dataclasses.replace(alone, names=("x",), lengths=None)
    assert np.array_equal(logits_of(found.network, alone)[0], logits[4])


def test_a_network_learns_from_windows() -> None:
    data = recordings()
    follows = for_recordings("skin", LENGTHS * 0.03, 0.03)
    experiment = experiment_of("skin", follows | {"hidden": 16}, 20, BinConfig())
    training = experiment.train
    assert (training.window_steps, training.windows, training.balanced) == (30, 4, True)
    fold = Fold.named(data, "*/1_*")
    found = train(Split(data, fold.images), experiment.network_config(data), training, 0)
    assert (predicted_classes(found.network, data, fold.test) == LABELS[fold.test]).mean() >= 0.9
    plain = references(data, fold.images, fold.test)
    assert plain["events"]["accuracy"] >= 0.9
    assert (plain["most frequent class"]["accuracy"], plain["most frequent class"]["balanced_accuracy"]) == (0.75, 0.5)


def test_every_class_weighs_the_same() -> None:
    weights = _class_weights(LABELS, 3)
    assert torch.allclose(weights[:2] * torch.tensor([18.0, 6.0]), torch.tensor(12.0))


def test_settings_follow_the_lengths() -> None:
    whole = for_recordings("skin", np.full(40, 8.0), 0.028)
    assert "window_steps" not in whole
    assert whole["decay"] == 1 - 2**-5
    assert "decay" not in for_recordings("tuned", np.full(40, 8.0), 0.028)
    long = for_recordings("skin", np.geomspace(4, 60, 600), 0.028)
    assert long == {
        "balanced": True, "window_steps": 179, "windows": 4, "batch": 32, "decay": 1 - 2**-4, "output_decay": 1 - 2**-6
    }  # fmt: skip


@pytest.mark.parametrize(("pattern", "words"), [("*", "all names fit"), ("c*", "no name fits"), ("b/*", "leaves no")])
def test_a_pattern_that_leaves_nothing_is_refused(pattern: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        Fold.named(recordings(), pattern)
