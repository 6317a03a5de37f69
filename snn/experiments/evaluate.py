"""Classify event files with a trained network, and compare RTL recordings with the model (docs/guide/classifier.md)."""

import contextlib
import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.classifier.file import IntegerWeights
from eskin.model.classifier.network import IntegerNetwork, lead
from eskin.model.events.compare import first_difference
from eskin.model.events.recording import Recording
from eskin.model.readout import Stimulus, simulate
from eskin.skin.recordings.folder import RecordingSet
from eskin.skin.recordings.trained_on import OwnReadout
from eskin.skin.textures.dataset import EMBEDDED, Texture, open_dataset
from eskin.skin.textures.presets import preset
from eskin.snn.data.bins import BinConfig, bin_recording
from eskin.snn.data.record import Tick
from eskin.snn.data.recordings import class_of
from eskin.snn.data.scans import ScanData, collect
from eskin.snn.exchange.weights import Weights, config_of, load_weights
from eskin.snn.experiments.trained import OTHER, TEST, TRAINING, Trained, result_beside
from eskin.snn.train import check_fits, logits_of, predicted_classes

LEVELS = ("events", "tensors", "logits", "predictions")
"""Data that ``check_model`` compares, in the order of their computation."""


def bin_recordings(recordings: Sequence[Recording], trained: Trained) -> ScanData:
    """Return the event counts of recordings for a network, one scan per recording.

    A recording needs no class for that; the label of one without is meaningless.

    Raise InputError if a class is unknown, a recording is empty, or array or encoding are not the network's.
    """
    classes = trained.weights.class_names
    complete = [
        recording
        if class_of(recording) is not None
        else dataclasses.replace(recording, metadata=recording.metadata | {"class": classes[0]})
        for recording in recordings
    ]
    data = collect(complete, trained.bins, classes)
    weights = trained.weights
    check_fits(config_of(weights.network) if isinstance(weights, Weights) else weights.network.config, data)
    return data


class Early(NamedTuple):
    """Class and seconds of an early decision."""

    predicted: int
    after_s: float


def answers(trained: Trained, data: ScanData) -> tuple[NDArray[Any], list[Early | None] | None]:
    """Return the logits of scans, and the early decision of each scan; None for a network without a margin.

    The logits of an integer network are its evidence. Shape (scans, classes).
    """
    network = trained.weights.network
    if not isinstance(network, IntegerNetwork):
        return logits_of(network, data), None
    evidence = [_evidence_of(network, data, scan) for scan in range(len(data))]
    margin = network.config.margin
    early = [_early(one, margin, data.step_s) for one in evidence] if margin else None
    return np.stack([one[-1] for one in evidence]), early


def _evidence_of(network: IntegerNetwork, data: ScanData, scan: int) -> NDArray[np.int64]:
    """Return the evidence after each bin of a scan, and after the delay of a stack; shape (bins, classes)."""
    bins = network.run_bins(data.values[[scan], : data.steps_of(scan)])
    return np.concatenate([state.evidence for state in bins])


def _early(evidence: NDArray[np.int64], margin: int, step_s: float) -> Early | None:
    """Return the early decision, or None without one; the seconds include the delay of a stack."""
    sure = lead(evidence) >= margin
    at = int(sure.argmax())
    return Early(int(evidence[at].argmax()), (at + 1) * step_s) if sure.any() else None


def without_unknown_class(recording: Recording, trained: Trained) -> Recording:
    """Return a recording without its class if the network does not know that class."""
    if class_of(recording) in (None, *trained.weights.class_names):
        return recording
    kept = {name: value for name, value in recording.metadata.items() if name not in ("class", "label")}
    return dataclasses.replace(recording, metadata=kept)


@dataclass
class Check:
    """Result of comparing RTL recordings with the model."""

    compared: list[int]
    """Indices of the compared RTL recordings."""
    events: int
    """Number of events of the compared recordings."""
    different: dict[str, list[int]]
    """Recordings that differ, by level of LEVELS."""
    logits: NDArray[np.float32]
    """Logits from the model's spikes, if compared. Shape (recordings, classes)."""
    first: str = ""
    """First difference in words, empty without differences."""
    where: int = -1
    """Index of the recording with the first difference."""

    @property
    def passed(self) -> bool:
        """True if at least one recording was compared and all recordings are equal."""
        return bool(self.compared) and not any(self.different.values())

    def note(self, level: str, number: int, text: str) -> None:
        """Record a difference between an RTL recording and the model; an empty text is none."""
        if text:
            self.different[level].append(number)
        if text and not self.first:
            self.first, self.where = text, number


def check_model(
    recordings: Sequence[Recording],
    data: ScanData,
    logits: NDArray[np.float32],
    trained: Trained,
    dataset: str | None = None,
    folder: Path | None = None,
    progress: Tick | None = None,
) -> Check:
    """Compare every RTL recording with the model: events, counts, logits and prediction.

    Raise InputError if a recording does not name its scan, or its texture is missing.

    - ``recordings``, ``data``, ``logits``: recordings, and the results of ``bin_recordings`` and ``logits_of``.
    - ``dataset``, ``folder``: places of the textures, if another than in the training, and of own recordings.
    - ``progress``: called after each comparison.
    """
    compared = [number for number, recording in enumerate(recordings) if recording.metadata.get("source") == "rtl"]
    check = Check(compared, 0, {level: [] for level in LEVELS}, logits)
    sources = _Sources(dataset, folder)
    values, classes = data.values.copy(), data.class_names
    for number in compared:
        rtl = recordings[number]
        check.events += len(rtl.events)
        expected, class_name = sources.expected(rtl)
        check.note("events", number, _event_difference(rtl, expected, class_name))
        values[number] = _counts(expected, trained.bins, data)
        if (unequal := np.argwhere(values[number] != data.values[number])).size:
            step, channel = unequal[0].tolist()
            place = f"step {step}, taxel {divmod(channel % data.taxels, rtl.config.columns)}, channel {channel}"
            counts = f"model {values[number, step, channel]} events, RTL {data.values[number, step, channel]}"
            check.note("tensors", number, f"{rtl.metadata['name']}: {place}: {counts}")
        if progress is not None:
            progress()
    check.logits, _ = answers(trained, dataclasses.replace(data, values=values))
    for number in compared:
        model, row = check.logits[number], logits[number]
        name = recordings[number].metadata["name"]
        if model.tobytes() != row.tobytes():
            check.note("logits", number, f"{name}: logits of the model {model.tolist()}, RTL {row.tolist()}")
        if model.argmax() != row.argmax():
            text = f"{name}: the model predicts {classes[model.argmax()]}, RTL {classes[row.argmax()]}"
            check.note("predictions", number, text)
    return check


def _event_difference(rtl: Recording, expected: Recording, class_name: str | None) -> str:
    """Return the first difference between an RTL recording and the model's recording, or an empty text."""
    name = rtl.metadata["name"]
    if class_of(rtl) not in (None, class_name):
        return f"{name} states the class {class_of(rtl)!r}, but its texture is of class {class_name!r}"
    if (difference := first_difference(expected.events, rtl.events)) is not None:
        return f"{name}: RTL and model differ\n{difference.describe(('model', 'RTL'))}"
    if rtl.duration_clocks < expected.duration_clocks:
        return f"{name} ends at clock {rtl.duration_clocks}, its scan lasts to clock {expected.duration_clocks}"
    return ""


def model_recording(rtl: Recording, texture: Texture) -> Recording:
    """Return the model's recording of the scan in an RTL recording.

    A replay continues after the last sample until the array is silent, so it is longer than a recording of
    ``eskin.snn.data.record.record``.
    """
    metadata, config = rtl.metadata, rtl.config
    start_row = metadata.get("start_row")
    if not isinstance(metadata.get("preset"), str) or not isinstance(start_row, (int, float)):
        raise InputError(f"{metadata['name']} has no preset and start row; play it again")
    try:
        samples, _ = preset(metadata["preset"]).samples(config, texture.load(), start_row)
    except InputError as error:
        raise InputError(f"the scan of {metadata['name']} cannot be repeated: {error}") from None
    if metadata.get("ticks", len(samples)) != len(samples):
        raise InputError(
            f"{metadata['name']} has {metadata['ticks']} sample ticks, but the scan of its texture has {len(samples)}; "
            f"play it completely with eskin replay"
        )
    return _as_long(rtl, samples)


def _as_long(rtl: Recording, samples: NDArray[np.int32]) -> Recording:
    """Return the model's recording of samples, at least as long as an RTL recording."""
    config = rtl.config
    clocks = max(rtl.duration_clocks, len(samples) * config.clocks_per_sample)
    events = simulate(config, Stimulus.from_samples(config, samples, clocks=clocks))
    return Recording(events, config, clocks, metadata=rtl.metadata | {"source": "model"})


@dataclass(frozen=True)
class _Sources:
    """Cache of opened input textures and recordings."""

    dataset: str | None
    folder: Path | None
    textures: dict[str, dict[str, Texture]] = field(default_factory=dict)
    sets: dict[str, RecordingSet] = field(default_factory=dict)

    def expected(self, rtl: Recording) -> tuple[Recording, str | None]:
        """Return the recording that the model makes from the input of an RTL recording, and the class of this input."""
        own = OwnReadout.of(rtl)
        if own is None:
            texture = self._texture(rtl.metadata["name"], rtl.metadata.get("dataset"))
            return model_recording(rtl, texture), texture.class_name
        name, place = rtl.metadata["name"], self.folder
        if place is None:
            raise InputError(f"{name} is one of your own recordings; name the folder of its samples with --data")
        key = json.dumps(own.to_dict(), sort_keys=True)
        if key not in self.sets:
            self.sets[key] = own.read(place)
        for source, codes in zip(self.sets[key].sources, self.sets[key].codes, strict=True):
            if source.name == name:
                ticks = rtl.metadata.get("ticks")
                return _as_long(rtl, codes[: ticks if isinstance(ticks, int) else None]), source.class_name
        raise InputError(f"{place} has no recording {name}; give its folder with --data")

    def _texture(self, name: str, dataset_name: Any) -> Texture:
        """Return the texture that was the input of a recording."""
        if not isinstance(dataset_name, str):
            raise InputError(f"{name} has no dataset name; play it again")
        if dataset_name not in self.textures:
            dataset = open_dataset(self.dataset or (EMBEDDED if dataset_name == EMBEDDED else None))
            if dataset.name != dataset_name:
                raise InputError(
                    f"{name} is a scan of dataset {dataset_name}, not of {dataset.name}; name its folder with --dataset"
                )
            self.textures[dataset_name] = {texture.name: texture for texture in dataset}
        if name not in self.textures[dataset_name]:
            raise InputError(f"dataset {dataset_name} has no texture {name!r}; give its folder with --dataset")
        return self.textures[dataset_name][name]


def _counts(expected: Recording, bins: BinConfig, data: ScanData) -> NDArray[Any]:
    """Return the counts of the model's recording in the shape of ``data``; None without events."""
    values = np.zeros_like(data.values[0])
    with contextlib.suppress(InputError):  # no event in the window, but the RTL recording had events
        counts = bin_recording(expected, bins)[: data.steps]
        values[: len(counts)] = counts
    return values


def scores(
    recordings: Sequence[Recording], data: ScanData, logits: NDArray[np.float32], trained: Trained
) -> dict[str, dict[str, Any]]:
    """Return the scores of the groups TEST, TRAINING and OTHER, for recordings with known class.

    A score has ``accuracy``, the numbers of ``correct`` predictions and of ``images``, ``confusion`` (rows are the
    classes, columns the predictions), and ``learned``: whether the training used the group.
    """
    found = {}
    parts = np.array([trained.part_of(recording) for recording in recordings])
    known = np.array([class_of(recording) is not None for recording in recordings])
    predicted = logits.argmax(1)
    for part in (TEST, TRAINING, OTHER):
        chosen = known & (parts == part)
        if chosen.any():
            confusion = np.zeros((len(data.class_names),) * 2, np.int64)
            np.add.at(confusion, (data.labels[chosen], predicted[chosen]), 1)
            correct, images = int(np.trace(confusion)), int(chosen.sum())
            found[part] = {
                "accuracy": correct / images,
                "correct": correct,
                "images": images,
                "confusion": confusion.tolist(),
                "learned": part == TRAINING,
            }
    return found


def integer_classes(
    network: IntegerNetwork, data: ScanData, images: Sequence[int] | NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the class predicted by the integer network for every image, from its first scan."""
    scans = data.first_scans(images)
    if data.of_one_length:
        return network.run_counts(data.values[scans])[0].argmax(1)
    rows = [network.run_counts(data.values[[scan], : data.steps_of(scan)])[0] for scan in scans]
    return np.concatenate(rows).argmax(1)


def early_decisions(
    network: IntegerNetwork, data: ScanData, images: Sequence[int] | NDArray[np.int64], margins: Sequence[int]
) -> list[dict[str, Any]]:
    """Return the result of early decisions at each margin, on the first scan of each image.

    A result has the ``margin``, the numbers of ``images``, of ``right`` classes, and of scans ``decided`` before their
    end, and the ``mean_s`` and ``median_s`` seconds until the decision. Scans without a decision count with their
    length and last class.
    """
    labels = data.image_labels[images]
    right, decided = np.zeros((2, len(margins), len(labels)), np.bool_)
    seconds = np.zeros((len(margins), len(labels)))
    for image, scan in enumerate(data.first_scans(images)):
        evidence = _evidence_of(network, data, scan)
        last = Early(int(evidence[-1].argmax()), len(evidence) * data.step_s)
        for number, margin in enumerate(margins):
            early = _early(evidence, margin, data.step_s)
            decided[number, image] = early is not None
            predicted, seconds[number, image] = early or last
            right[number, image] = predicted == labels[image]
    return [
        {
            "margin": margin,
            "right": int(right[number].sum()),
            "images": len(labels),
            "decided": int(decided[number].sum()),
            "mean_s": float(seconds[number].mean()),
            "median_s": float(np.median(seconds[number])),
        }
        for number, margin in enumerate(margins)
    ]


def compare_integer(weights_file: Path, made: IntegerWeights) -> str:
    """Return a sentence with the accuracies of float and integer network on the test images, and of early decisions.

    Raise InputError if no result of the training is beside the weights, or the training used frames.
    """
    weights = load_weights(weights_file)
    result = result_beside(weights_file, weights)
    if result is None:
        raise InputError(f"--accuracy needs the result.json of the training beside {weights_file.name}")
    data = result.experiment.data()
    images = result.test_images(data.image_labels)
    if not len(images):
        raise InputError(f"{weights_file} was trained on all recordings, so --accuracy has no test recordings")
    labels = data.image_labels[images]
    right = int((predicted_classes(weights.network, data, images) == labels).sum())
    whole = int((integer_classes(made.network, data, images) == labels).sum())
    said = f"test images of the fold: float {right} of {len(labels)} right, integer {whole} of {len(labels)}"
    if margin := made.network.config.margin:
        (early,) = early_decisions(made.network, data, images, [margin])
        said += (
            f"\nearly decision: {early['right']} right after {early['mean_s']:.3g} s on average, "
            f"{early['decided']} of {early['images']} by the margin"
        )
    return said


def predictions(
    recordings: Sequence[Recording],
    logits: NDArray[np.float32],
    trained: Trained,
    scores: dict[str, dict[str, Any]],
    check: Check | None = None,
    early: Sequence[Early | None] | None = None,
) -> dict[str, Any]:
    """Return predictions and logits of every recording, and the accuracy of each group, as a dictionary for JSON.

    - ``logits``, ``early``: results of ``answers``. With ``early``, each recording has the class ``early`` and the
      seconds ``early_s``, or None in both.
    - ``scores``: result of ``scores``.
    - ``check``: result of ``check_model``.
    """
    names = trained.weights.class_names
    images = []
    for number, (recording, row) in enumerate(zip(recordings, logits, strict=True)):
        image = {
            "name": recording.metadata["name"],
            "source": recording.metadata.get("source"),
            "class": class_of(recording),
            "part": trained.part_of(recording) if trained.parts else None,
            "predicted": names[row.argmax()],
            "logits": row.tolist(),
        }
        if early is not None:
            decision = early[number]
            image["early"] = None if decision is None else names[decision.predicted]
            image["early_s"] = None if decision is None else decision.after_s
        if check is not None and number in check.compared:
            image["model_predicted"] = names[check.logits[number].argmax()]
        images.append(image)
    report: dict[str, Any] = {
        "class_names": list(names),
        "step_s": trained.bins.bin_s,
        "readout": recordings[0].config.to_dict(),
        "accuracy": {part if trained.parts else "all": score for part, score in scores.items()},
    }
    if check is not None:
        report["check"] = {
            "compared": len(check.compared),
            "events": check.events,
            "different": {
                level: [recordings[number].metadata["name"] for number in numbers]
                for level, numbers in check.different.items()
            },
        }
    return report | {"images": images}
