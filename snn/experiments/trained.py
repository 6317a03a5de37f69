"""Load a trained network with the result of its training."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import nn

from eskin.base.errors import InputError
from eskin.base.files import read_json
from eskin.model.classifier.file import IntegerWeights, is_integer
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.recordings.trained_on import OwnReadout, TrainingNotes
from eskin.skin.textures.dataset import open_dataset
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.folds import stratified_folds
from eskin.snn.data.record import Tick
from eskin.snn.data.recordings import event_files
from eskin.snn.data.scans import load_recordings
from eskin.snn.exchange.weights import Weights, arrays_of, check_class_names, weights_of
from eskin.snn.experiments.experiment import Experiment

TEST, TRAINING, OTHER = "test", "training", "other"
"""Groups of recordings: of the test fold, of the training images, or of neither."""


@dataclass(frozen=True)
class TrainingResult:
    """Content of ``result.json`` written by ``eskin train``."""

    experiment: Experiment
    class_names: tuple[str, ...]
    fold: int
    folds: int
    labels: list[int]
    """Labels of the test images."""
    own: OwnReadout | None = None
    """Readout, if the data were a user's recordings."""
    predicted: list[int] = field(default_factory=list)
    """Predictions for the test images; empty if the file has none."""
    tested: list[int] | None = None
    """Test images, if selected by name instead of by fold."""

    @property
    def right(self) -> list[bool]:
        """Correctness of the prediction for each test image; empty if unknown."""
        return [a == b for a, b in zip(self.labels, self.predicted, strict=True)] if self.predicted else []

    def default_image(self, test: NDArray[np.int64]) -> int:
        """Return the first test image known to be classified correctly, else the first test image."""
        return int(test[self.right.index(True)] if True in self.right else test[0])

    def test_images(self, labels: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the test images of the fold; raise an error for labels other than in the training."""
        if self.tested is None:
            test = stratified_folds(labels, self.folds)[self.fold]
        else:
            test = np.array([number for number in self.tested if number < len(labels)], np.int64)
        if labels[test].tolist() != self.labels:
            raise InputError("the images differ from the training images; give the training's textures with --dataset")
        return test


def read_result(path: Path, weights_file: Path, weights: Weights) -> TrainingResult:
    """Return the result of the training that produced given weights.

    Raise InputError if the file is damaged or something else, or belongs to other weights.
    """
    try:
        content = read_json(path, "the result of the training", dict)
        result = TrainingResult(
            experiment=Experiment.from_dict(content["experiment"]),
            class_names=check_class_names(content["class_names"], len(weights.class_names)),
            fold=content["fold"],
            folds=content["folds"],
            labels=content["labels"],
            own=OwnReadout.from_dict(content["recordings"]) if content.get("recordings") else None,
            predicted=content.get("predicted", []),
            tested=content.get("test_images"),
        )
        numbers = [result.fold, result.folds, *result.labels, *result.predicted, *(result.tested or [])]
        if not all(type(number) is int for number in numbers) or not 0 <= result.fold < result.folds:
            raise ValueError
        if len(result.predicted) not in (0, len(result.labels)):
            raise ValueError
    except (KeyError, TypeError, ValueError, AttributeError):
        raise InputError(f"{path} is damaged or not the result of a training; remove it or train again") from None
    same_bins = result.experiment.frames is not None or result.experiment.bins.bin_s == weights.step_s
    if result.class_names != weights.class_names or not same_bins:
        raise InputError(
            f"{path} has other classes or time bins than {weights_file.name}; keep matching files together"
        )
    return result


def result_beside(path: Path, weights: Weights) -> TrainingResult | None:
    """Return the result of the training beside a weight file, or None without one."""
    note = path.parent / "result.json"
    return read_result(note, path, weights) if note.exists() else None


def _missing(path: Path) -> str:
    return f"result.json of the training is missing beside {path.name}"


@dataclass(frozen=True)
class Trained:
    """A network from a file, with the result of its training."""

    weights: Weights | IntegerWeights
    bins: BinConfig
    """Time bins of the training; without a training result, the defaults with the step of the weights."""
    parts: Mapping[str, str] = field(default_factory=dict)
    """TEST or TRAINING by image name; empty if unknown."""
    dataset: str | None = None
    """Name of the dataset of the images, or of the folder of recordings; None for other event files."""
    unknown: str = ""
    """Reason why ``parts`` is empty."""
    readout: ReadoutConfig | None = None
    """Readout of the training, if known."""
    own: OwnReadout | None = None
    """Preparation and readout of the user's recordings in the training."""
    of_recordings: bool = False
    """True if the training used event files instead of textures."""
    rest: str = OTHER
    """Group of the images of the dataset that ``parts`` does not name."""

    def other_fields(self, config: ReadoutConfig) -> list[str]:
        """Return a text for each field in which a readout differs from the readout of the training."""
        if self.readout is None:
            return []
        fields, learned = config.to_dict(), self.readout.to_dict()
        return [
            f"{name} {fields[name]}, in training {learned[name]}" for name in fields if fields[name] != learned[name]
        ]

    def part_of(self, recording: Recording) -> str:
        """Return the group of a recording: TEST, TRAINING or OTHER."""
        other = self.dataset is not None and recording.metadata.get("dataset") != self.dataset
        return OTHER if other else self.parts.get(str(recording.metadata.get("name")), self.rest)


def load_trained(path: Path) -> Trained:
    """Return the network from a weight file, with bins and folds from ``result.json`` beside it.

    An integer network has them in its notes.

    Raise InputError if a file is missing or damaged, the two do not belong together, or the network takes frames.
    """
    arrays = arrays_of(path)
    if is_integer(arrays):
        return _of_notes(path, IntegerWeights.of(path, arrays))
    weights = weights_of(path, arrays)
    result = result_beside(path, weights)
    if result is None:
        return Trained(weights, BinConfig(bin_s=weights.step_s), unknown=_missing(path))
    experiment = result.experiment
    if experiment.frames is not None:
        raise InputError(f"{path} was trained on frames and cannot classify events; train it without --frames")
    own = result.own
    readout = experiment.scan_and_config()[1] if experiment.events is None else own.config if own else None
    of_recordings = experiment.events is not None
    found = Trained(weights, experiment.bins, readout=readout, own=own, of_recordings=of_recordings)
    try:
        names, labels, dataset = _images_of(experiment, result.class_names, own is not None)
    except InputError as error:
        return replace(found, unknown=f"the images of the training are missing ({error})")
    try:
        parts = dict.fromkeys(names, TRAINING) | {names[n]: TEST for n in result.test_images(labels)}
    except InputError as error:
        return replace(found, unknown=str(error))
    return replace(found, parts=parts, dataset=dataset)


def _of_notes(path: Path, weights: IntegerWeights) -> Trained:
    """Return an integer network with the notes on its training."""
    notes = TrainingNotes.of(weights, path)
    readout = notes.readout if notes.own is None else notes.own.config
    bins = BinConfig(bin_s=notes.bin_s, polarity=weights.network.config.inputs > readout.taxels)
    parts = {} if notes.dataset is None else dict.fromkeys(notes.tested, TEST)
    unknown = f"{path.name} does not name the images of its training"
    rest = TRAINING if parts else OTHER
    return Trained(weights, bins, parts, notes.dataset, unknown, readout, notes.own, notes.preset is None, rest)


def accuracies_on_test(
    path: Path, weights: Weights, networks: Mapping[str, nn.Module], progress: Tick | None = None
) -> tuple[int, dict[str, float]]:
    """Return the number of test images of a training, and the accuracy of each network by name.

    Raise InputError if the result or the images of the training are missing.

    - ``path``: weight file of the training, with ``result.json`` beside it.
    - ``progress``: called while scans are recorded.
    """
    from eskin.snn.train import predicted_classes

    result = result_beside(path, weights)
    if result is None:
        raise InputError(_missing(path))
    data = result.experiment.data(progress)
    if data.class_names != result.class_names:
        raise InputError("the images differ from the training images; give the training's textures with --dataset")
    test = result.test_images(data.image_labels)
    labels = data.image_labels[test]
    found = {name: predicted_classes(network, data, test) == labels for name, network in networks.items()}
    return len(test), {name: float(right.mean()) for name, right in found.items()}


def said_of_training(path: Path, weights: Weights) -> dict[str, Any]:
    """Return a dictionary about the training for files made from its weights; empty without a result.

    The fields are ``readout``, ``preset``, ``dataset``, ``bin_s``; ``wiring``: skin and chosen taxels, or None;
    ``tested``: the predicted class number of every image outside the training, by name; and ``recordings``: how a
    user's recordings were prepared.
    """
    result = result_beside(path, weights)
    if result is None:
        return {}
    experiment = result.experiment
    names, labels, dataset = _images_of(experiment, result.class_names, result.own is not None)
    if experiment.events is not None:
        experiment = experiment.with_readout_of_events()
    wiring = None
    if experiment.taxels:
        wiring = {"skin": [experiment.readout.rows, experiment.readout.columns], "taxels": list(experiment.taxels)}
    readout = result.own.config if result.own else experiment.scan_and_config()[1]
    tested = [names[number] for number in result.test_images(labels)]
    return {
        "readout": readout.to_dict(),
        "preset": experiment.preset,
        "wiring": wiring,
        "dataset": dataset,
        "bin_s": experiment.bins.bin_s,
        "tested": dict(zip(tested, result.predicted, strict=True)) if result.predicted else {},
        "recordings": result.own.to_dict() if result.own else None,
    }


def _images_of(
    experiment: Experiment, classes: Sequence[str], own: bool
) -> tuple[Sequence[str], NDArray[np.int64], str | None]:
    if experiment.events is not None:
        folder = Path(experiment.events)
        data = load_recordings(folder, experiment.bins, classes)
        said = Recording.load(event_files([folder])[0].path).metadata.get("dataset") if own else None
        return data.names, data.image_labels, said
    dataset = open_dataset(experiment.dataset)
    if dataset.class_names != tuple(classes):
        raise InputError(f"dataset {dataset.name} has other classes")
    return [texture.name for texture in dataset], dataset.labels, dataset.name
