"""Test trained networks on disturbed scans, for all folds, seeds, disturbances and strengths.

A scan of an image is disturbed equally for all networks, so that their answers are paired. Each cell is a file, so a
stopped run continues with the missing cells.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.files import read_json, write_json
from eskin.base.shapes import misfit
from eskin.skin.textures.dataset import open_dataset
from eskin.skin.textures.physical import PhysicalScan
from eskin.snn.data.disturb import DISTURBANCES, check_strength, record_disturbed
from eskin.snn.data.scans import ScanData, collect
from eskin.snn.exchange.weights import Weights, config_of, load_weights
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.intervals import scored
from eskin.snn.experiments.points import as_word
from eskin.snn.experiments.trained import read_result

CLEAN = "clean"
"""Name of the scans without a disturbance."""

Case = tuple[str, float]
"""Disturbance and strength."""


@dataclass(frozen=True)
class Subject:
    """A trained network under test."""

    network: str
    """Name shared by its folds and seeds: the parent folder of the training."""
    fold: int
    seed: int
    weights: Weights
    experiment: Experiment
    images: NDArray[np.int64]
    """Test images."""
    digest: str
    """Digest of the weight file."""

    @classmethod
    def load(cls, file: Path, scenes: bool = True) -> Subject:
        """Return the network from a weight file, with ``result.json`` beside it.

        With ``scenes`` others than of events of physical scans are refused.
        """
        weights, note = load_weights(file), file.parent / "result.json"
        if not note.exists():
            raise InputError(f"{note.name} of the training is missing beside {file}; give a folder of eskin train")
        result = read_result(note, file, weights)
        experiment = result.experiment
        if experiment.events is not None or experiment.variant:
            raise InputError(f"{file} was trained on event files or a variant of an encoder; train it on textures")
        if scenes and (experiment.frames is not None or experiment.preset != "physical"):
            raise InputError(f"{file} was not trained on events of physical scans, which this study needs")
        dataset = open_dataset(experiment.dataset)
        if dataset.class_names != result.class_names:
            raise InputError(
                f"{file} was trained on other classes than those of {dataset.name}; train again with --dataset"
            )
        seed = read_json(note, "the result", dict).get("seed", 0)
        digest = hashlib.sha256(file.read_bytes()).hexdigest()[:16]
        name = file.resolve().parent.parent.name
        return cls(name, result.fold, seed, weights, experiment, result.test_images(dataset.labels), digest)

    @property
    def name(self) -> str:
        """Name of this network among all, for its files."""
        return f"{self.network}-fold-{self.fold}-seed-{self.seed}"

    @property
    def recorded_as(self) -> str:
        """Text that identifies the test scans of a network."""
        _, config = self.experiment.scan_and_config()
        return repr((self.experiment.dataset, config, self.experiment.bins, self.images.tolist()))


def kept_cell(subject: Subject, path: Path, key: dict[str, Any], make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Return the test results of a network, read from a file or computed.

    - ``key``: the request of the study; the message names its last field.
    - ``make``: returns labels and answers.

    Raise InputError if the file is of other weights or images, or the study was asked for something else.
    """
    whole = {"weights": subject.digest} | key | {"images": subject.images.tolist()}
    if path.exists():
        cell: dict[str, Any] = read_json(path, "the results of a network", dict)
        if {name: cell.get(name) for name in whole} != whole:
            other = list(key)[-1].removesuffix("_v")
            raise InputError(f"{path} belongs to other weights, {other} or images; remove it or choose another --out")
        return cell
    cell = {name: getattr(subject, name) for name in ("network", "fold", "seed")} | whole | make()
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(path, cell)
    return cell


Cells = Sequence[dict[str, Any]]
"""Answers of trainings: ``network``, ``fold``, ``seed``, ``images``; ``labels`` and ``predicted`` of each image."""


_CELL = {"network": str, "fold": int, "seed": int, "labels": [int], "predicted": [int], "rate_hz": float}


def by_case(cells: Cells, *names: str) -> list[tuple[dict[str, Any], list[dict[str, Any]]]]:
    """Return each combination of values of some fields, with its cells."""
    found: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for cell in cells:
        found.setdefault(tuple(cell[name] for name in names), []).append(cell)
    return [(dict(zip(names, values, strict=True)), parts) for values, parts in found.items()]


def right_by_image(cells: Cells) -> NDArray[np.float64]:
    """Return the correctness of predictions, shape (images, seeds); NaN where no training of a seed had the image."""
    images = np.unique(np.concatenate([cell["images"] for cell in cells]))
    seeds = sorted({cell["seed"] for cell in cells})
    right = np.full((len(images), len(seeds)), np.nan)
    for cell in cells:
        rows = np.searchsorted(images, cell["images"])
        right[rows, seeds.index(cell["seed"])] = np.equal(cell["predicted"], cell["labels"])
    return right


def score_of(cells: Cells) -> dict[str, Any]:
    """Return accuracy and intervals, and the folds and seeds.

    If a seed lacks images, an image counts with the mean over its seeds.
    """
    right = right_by_image(cells)
    return {
        **scored(np.nanmean(right, 1, keepdims=True) if np.isnan(right).any() else right),
        **{f"{name}s": sorted({cell[name] for cell in cells}) for name in ("fold", "seed")},
    }


def in_words(cells: Cells) -> list[dict[str, Any]]:
    """Return answers with a digit for each image (``as_word``), by fold and seed."""
    return [
        {name: cell[name] for name in ("fold", "seed", "images")}
        | {name: as_word(cell[name]) for name in ("labels", "predicted")}
        for cell in sorted(cells, key=lambda cell: (cell["fold"], cell["seed"]))
    ]


def cases(names: Sequence[str]) -> list[Case]:
    """Return the clean case, and all strengths of the named disturbances.

    Raise InputError if a disturbance is unknown. ``NAME=STRENGTH`` selects one strength.
    """
    found: list[Case] = [(CLEAN, 0.0)]
    for text in names:
        name, equals, value = text.partition("=")
        if equals:
            try:
                strengths: tuple[float, ...] = (float(value),)
            except ValueError:
                raise InputError(f"the strength of {name} must be a number, not {value!r}") from None
        else:
            strengths = DISTURBANCES[name].strengths if name in DISTURBANCES else (0.0,)
        for strength in strengths:
            check_strength(name, strength)
            found.append((name, strength))
    return list(dict.fromkeys(found))


def disturbed_scans(experiment: Experiment, images: NDArray[np.int64], case: Case) -> ScanData:
    """Return the event counts of images under a disturbance, in the order of ``images``."""
    scan, config = experiment.scan_and_config()
    assert isinstance(scan, PhysicalScan)
    dataset = open_dataset(experiment.dataset)
    name, strength = case
    strengths = {} if name == CLEAN else {name: strength}
    key = [list(DISTURBANCES).index(name) if name in DISTURBANCES else len(DISTURBANCES), round(1e6 * strength)]
    recordings = [
        record_disturbed(dataset[i], dataset.name, scan, config, strengths, np.random.default_rng([*key, int(i)]))
        for i in images
    ]
    return collect(recordings, experiment.bins, dataset.class_names)


def run_cells(
    subjects: Sequence[Subject], chosen: Sequence[Case], out: Path, progress: Callable[[], object]
) -> list[dict[str, Any]]:
    """Return the test results of all networks in all cases; results stored in ``out`` are reused.

    Raise InputError if a file is of other weights, or damaged.
    """
    found = []
    for disturbance, strength in chosen:
        scans: dict[str, ScanData] = {}
        for subject in subjects:
            path = out / subject.name / f"{disturbance}-{strength:g}.json"
            key = {"disturbance": disturbance, "strength": strength}
            cell = kept_cell(subject, path, key, partial(_test, subject, (disturbance, strength), scans))
            if misfit(cell, _CELL) or not len(cell["labels"]) == len(cell["predicted"]) == len(subject.images):
                raise InputError(f"{path} is damaged; remove it")
            found.append(cell)
            progress()
    return found


def _test(subject: Subject, case: Case, scans: dict[str, ScanData]) -> dict[str, Any]:
    """Return the predictions of a network; ``scans`` has the disturbed scans of other networks."""
    from eskin.snn.train import check_fits, logits_of

    if subject.recorded_as not in scans:
        scans[subject.recorded_as] = disturbed_scans(subject.experiment, subject.images, case)
    network, data = subject.weights.network, scans[subject.recorded_as]
    check_fits(config_of(network), data)
    return {
        "labels": data.labels.tolist(),
        "predicted": logits_of(network, data).argmax(1).tolist(),
        "rate_hz": data.rate_hz,
    }


def summarise(cells: Cells) -> list[dict[str, Any]]:
    """Return accuracy, intervals and predictions for every network, disturbance and strength."""
    found = []
    for case, parts in by_case(cells, "network", "disturbance", "strength"):
        parts.sort(key=lambda cell: (cell["fold"], cell["seed"]))
        rates_hz, sizes = [cell["rate_hz"] for cell in parts], [len(cell["images"]) for cell in parts]
        answers = [{name: cell[name] for name in ("fold", "seed", "images", "labels", "predicted")} for cell in parts]
        rate_hz = float(np.average(rates_hz, weights=sizes))
        found.append(case | score_of(parts) | {"rate_hz": rate_hz, "answers": answers})
    return found
