"""Trained networks of the studies: their test scans, stored answers, scores and comparisons."""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.files import digest, read_json
from eskin.base.workers.engine import Pool, each
from eskin.base.workers.store import Store
from eskin.skin.textures.dataset import open_dataset
from eskin.snn.data.scans import ScanData
from eskin.snn.exchange.weights import Weights, load_weights
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.intervals import scored
from eskin.snn.experiments.pairs import common_answers, compare
from eskin.snn.experiments.points import as_word
from eskin.snn.experiments.trained import read_result

TRAINED = Path("out/train")
"""Folder of trainings, NETWORK/TRAINING/ each; the search includes all folders with this beginning of the name."""

ONE_SEED = ("accuracy_first", "accuracy_second", "only_first", "only_second", "p")
"""Fields of Pair with a value for every seed."""


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


def trained_networks(scenes: bool = False) -> list[Subject]:
    """Return the suitable networks below ``TRAINED``; others are named on standard error.

    With ``scenes``, only networks on events of physical scans suit. Raises InputError if no network suits, or two have
    the same names, folds and seeds.
    """
    import torch

    torch.set_num_threads(1)
    found, left_out = [], []
    for file in sorted(TRAINED.parent.glob(f"{TRAINED.name}*/**/weights.npz")):
        try:
            subject = Subject.load(file, scenes)
        except InputError as error:
            left_out.append(str(error))
        else:
            alone = file.parent.parent == TRAINED.parent
            found.append(dataclasses.replace(subject, network=file.parent.name) if alone else subject)
    if not found:
        why = f"no network in {TRAINED} suits ({left_out[0]})" if left_out else f"no trained network in {TRAINED}"
        raise InputError(f"{why}; make one with eskin train{' --preset physical' * scenes}")
    for text in left_out:
        print(f"left out: {text}", file=sys.stderr)
    names = [subject.name for subject in found]
    if twice := [subject for subject in found if names.count(subject.name) > 1]:
        one = twice[0]
        raise InputError(
            f"network {one.network!r} has two trainings with fold {one.fold} and seed {one.seed}; rename a folder"
        )
    return found


Answers = Callable[[Sequence[Subject], Mapping[str, Any]], list[dict[str, Any]]]
"""Function that returns labels and answers of networks in a case."""


def tested(
    pool: Pool,
    store: Store,
    answers: Answers,
    jobs: Sequence[tuple[Sequence[Subject], Mapping[str, Any]]],
    progress: Callable[[], object],
) -> list[dict[str, Any]]:
    """Return the results of networks in cases, stored or computed.

    - ``jobs``: networks that are tested together, and the fields that determine their test.
    - ``progress``: called after each network.
    """

    def name(subjects: Sequence[Subject], case: Mapping[str, Any]) -> str:
        return str(digest([[(one.name, one.digest, one.images.tolist()) for one in subjects], case]))

    found = []
    for (subjects, case), made in zip(jobs, each(pool, answers, jobs, store=store, name=name), strict=True):
        for subject, own in zip(subjects, made, strict=True):
            about = {field: getattr(subject, field) for field in ("network", "fold", "seed")}
            found.append({**about, "images": subject.images.tolist(), **case, **own})
            progress()
    return found


Cells = Sequence[dict[str, Any]]
"""Answers of trainings: ``network``, ``fold``, ``seed``, ``images``; ``labels`` and ``predicted`` of each image."""


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


def logits_after(steps: int, network: Any, data: ScanData, scans: Any, device: str = "cpu") -> NDArray[np.float32]:
    """Return the logits of a network after some steps of scans, shape (scans, classes)."""
    from eskin.snn.train import logits_of

    return logits_of(network, dataclasses.replace(data, values=data.values[:, :steps], lengths=None), scans, device)


def paired(points: Sequence[dict[str, Any]], first: str, second: str, of: Sequence[str]) -> list[dict[str, Any]]:
    """Return McNemar's tests of two networks on common images.

    Each test compares two points with equal values of the fields ``of``. A point is a result with the fields
    ``network`` and ``answers``: labels and predictions by fold and seed.
    """
    found = []
    for point in points:
        same = [p for p in points if p["network"] == second and all(p[name] == point[name] for name in of)]
        if point["network"] != first or not same:
            continue
        answers = common_answers(point, same[0])
        if not answers.labels:
            continue
        result = compare(*answers)
        of_seed = {name: getattr(result, name)[0] for name in ONE_SEED}
        about = {"first": first, "second": second} | {name: point[name] for name in of}
        found.append(about | {"images": result.images} | of_seed)
    return found


def all_pairs(points: Sequence[dict[str, Any]], of: Sequence[str]) -> list[dict[str, Any]]:
    """Return McNemar's tests of every two networks, as in ``paired``."""
    networks = sorted({point["network"] for point in points})
    return [one for names in itertools.combinations(networks, 2) for one in paired(points, *names, of)]
