"""Measure accuracy against events/s, bits/s and power for readouts of selected taxels.

Readouts, choices of taxels and networks are combined to points. All points of a network share its training: the same
number of scans, epochs and settings for events and frames. A cell is one fold and seed of a point, or one inner
validation, which trains on 160 of the 200 training images and is judged on the other 40.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np

from eskin.base.errors import InputError
from eskin.base.files import Pieces, plain
from eskin.model.config import ReadoutConfig
from eskin.power.readouts import EQUATIONS
from eskin.skin.textures.choice import choose
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.folds import INNER_FOLDS, stratified_folds
from eskin.snn.data.frame_steps import FrameKind
from eskin.snn.data.scans import ScanData, Split
from eskin.snn.experiments.coded import coded_bps
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.intervals import bootstrap
from eskin.snn.experiments.pairs import compare, right_of
from eskin.snn.experiments.points import Sweep, as_word
from eskin.snn.experiments.settings import experiment_of
from eskin.snn.experiments.sweep import SweepPoint
from eskin.snn.reference import LEAST_RATE, logistic_classes
from eskin.snn.studies.noise import Rates, power_of

FOLDS = 6

SKIN = (8, 8)
"""Rows and columns of the skin on which taxels are chosen (paper, section II)."""

NOISE_V = 1e-3
"""AFE noise at which power is given: the middle one of the paper's Fig. 6."""

NETWORKS: dict[str, dict[str, dict[str, Any]]] = {
    "physical": {
        "leaky": {"recipe": "tuned", "hidden": 128, "learning_rate": 3e-3},
        "leaky-2ms": {
            "recipe": "tuned",
            "hidden": 128,
            "learning_rate": 3e-3,
            "bin_s": 0.002,
            "shift_steps": 20,
            "decay": 0.9,
            "output_decay": 0.975,
        },
        "convolutions": {"recipe": "cnn", "hidden": 128, "learning_rate": 3e-3},
        "paper": {"recipe": "paper"},
    },
    "paper": {"leaky": {"recipe": "tuned"}, "convolutions": {"recipe": "cnn"}, "paper": {"recipe": "paper"}},
}
"""Recipe and changed settings of every network, by preset; equal for all readouts."""

SCANS: dict[str, dict[str, Any]] = {
    "physical": {"start_rows": 24, "epochs": 10},
    "paper": {"start_rows": 1, "epochs": 120},
}
"""Scans of each image, and passes over them, by preset; equal for all readouts and networks."""

SWEEPS = {"rates-cnn": "convolutions", "rates-paper": "paper"}
"""Networks of the sweeps of the project whose points belong to the frontier: all taxels, ``paper`` scans."""

PLAN: dict[str, int] = {
    "physical/leaky/lcs:2/across:8": 1,
    "physical/leaky/nlcs-bipolar:2/across:8": 1,
    "physical/leaky/nlcs:5/across:8": 1,
    "physical/leaky/lcs:2/12x16:across:12": 3,
    "physical/leaky/frame-onoff:250:3:2/12x16:across:12": 3,
    "physical/leaky-2ms/lcs:2/12x16:across:12": 3,
    "physical/leaky-2ms/frame-onoff:250:3:2/12x16:across:12": 3,
    "physical/convolutions/lcs:2/12x16:across:12": 2,
    "physical/convolutions/frame-diff:250:6/12x16:across:6": 2,
    "physical/convolutions/lcs:3/12x16:across:2": 3,
    "physical/convolutions/frame-diff:250:7/12x16:across:1": 1,
    "physical/convolutions/frame-diff:250:4/12x16:across:2": 3,
    "paper/convolutions/lcs:4/along:6": 1,
    "paper/convolutions/lcs:5/along:3": 3,
    "paper/convolutions/frame-diff:250:5/along:6": 1,
}
"""Seeds of every point that is trained for docs/results/frontier.md."""

CANDIDATES: dict[str, int] = {
    "physical/leaky/lcs:3/across:4": 1,
    "physical/leaky/lcs:2/across:8": 1,
    "physical/leaky/lcs:2/along:8": 1,
    "physical/leaky/lcs:2/12x16:across:12": 1,
    "physical/leaky/frame-onoff:125:6:4/12x16:across:12": 1,
    "physical/leaky/frame-onoff:125:6:3/12x16:across:12": 1,
    "physical/leaky/frame-onoff:250:3:2/12x16:across:12": 1,
    "physical/leaky/frame-onoff:250:6:4/12x16:across:6": 1,
    "physical/leaky-2ms/frame-onoff:250:3:2/12x16:across:12": 1,
    "physical/leaky-2ms/frame-onoff:500:3:2/12x16:across:6": 1,
    "physical/convolutions/frame-diff:250:3/12x16:across:12": 1,
    "physical/convolutions/frame-diff:250:6/12x16:across:6": 1,
    "physical/convolutions/lcs:2/12x16:across:5": 1,
    "physical/convolutions/lcs:2/across:6": 1,
    "physical/convolutions/lcs:2/12x16:along:6": 1,
    "physical/convolutions/lcs:3/12x16:across:2": 1,
    "physical/convolutions/lcs:3/12x16:across:3": 1,
    "physical/convolutions/lcs:3/across:2": 1,
    "physical/convolutions/lcs:4/12x16:across:1": 1,
    "physical/leaky-2ms/lcs:3/12x16:across:2": 1,
    "physical/convolutions/frame-diff:125:7/12x16:across:2": 1,
    "physical/convolutions/frame-diff:250:4/12x16:across:2": 1,
    "physical/convolutions/frame-diff:125:4/12x16:across:4": 1,
    "physical/convolutions/frame-diff:250:7/12x16:across:1": 1,
    "paper/convolutions/lcs:4/across:6": 1,
    "paper/convolutions/lcs:4/along:6": 1,
    "paper/convolutions/lcs:4/12x16:along:6": 1,
    "paper/convolutions/lcs:4/12x16:along:7": 1,
    "paper/convolutions/lcs:3/12x16:across:12": 1,
    "paper/convolutions/lcs:3/12x16:along:12": 1,
    "paper/convolutions/lcs:5/across:3": 1,
    "paper/convolutions/lcs:5/along:3": 1,
    "paper/convolutions/frame-diff:125:8/along:8": 1,
    "paper/convolutions/frame-diff:250:5/along:6": 1,
    "paper/convolutions/frame-diff:250:8/along:4": 1,
}
"""Folds of inner validation of the readouts among which those of PLAN were chosen."""

AS_EQUAL = 1.6
"""Data rates of events and frames that are compared differ by less than this factor."""


SHAPE = {
    "points": [
        {
            "name": str,
            "readout": str,
            "preset": str,
            "network": str,
            "taxels": [int],
            "seeds": int,
            "rate_hz": float,
            "bits_per_s": float,
            "coded_bits_per_s": float,
            "power_w": (float, None),
            "accuracy": float,
            "interval": [float],
        }
    ]
}
"""Fields of ``frontier.json`` that the figure needs."""


@dataclass(frozen=True)
class Point:
    """A readout of selected taxels with a network.

    Attributes
    ----------
    preset : str
    network : str
        A key of NETWORKS.
    readout : str
        ENCODER:RESOLUTION, or frames as in ``FrameSteps.parse``.
    taxels : str
        ``all``, or as in ``eskin.skin.textures.choice.choose``; ``ROWSxCOLUMNS:`` before it names another skin.
    """

    preset: str
    network: str
    readout: str
    taxels: str = "all"

    @classmethod
    def parse(cls, text: str) -> Point:
        """Return the point for a text PRESET/NETWORK/READOUT/TAXELS."""
        words = text.split("/")
        if len(words) != 4 or words[1] not in NETWORKS.get(words[0], ()):
            raise InputError(
                f"a point must be PRESET/NETWORK/READOUT/TAXELS with one of {', '.join(SCANS)} and one of "
                f"{', '.join(NETWORKS['physical'])}, such as physical/leaky/lcs:3/across:4, not {text!r}"
            )
        point = cls(*words)
        point.experiment()
        return point

    @property
    def name(self) -> str:
        """Text accepted by ``parse``."""
        return f"{self.preset}/{self.network}/{self.readout}/{self.taxels}"

    @property
    def skin(self) -> tuple[tuple[int, int], str]:
        """Rows and columns of the skin, and the selection of its taxels."""
        found = re.fullmatch(r"(\d+)x(\d+):(.+)", self.taxels)
        return ((int(found[1]), int(found[2])), found[3]) if found else (SKIN, self.taxels)

    def experiment(self, dataset: str | None = None) -> Experiment:
        """Return the experiment of this point."""
        settings = dict(NETWORKS[self.preset][self.network])
        kind, _, number = self.readout.partition(":")
        (rows, columns), choice = self.skin
        readout, frames = ReadoutConfig(rows=rows, columns=columns), self.readout
        if kind not in get_args(FrameKind):
            if not number.isdigit():
                raise InputError(f"a readout must be ENCODER:RESOLUTION or frames, not {self.readout!r}")
            readout, frames = readout.replace(encoding=kind, resolution=int(number)), ""
        return experiment_of(
            settings.pop("recipe"),
            settings,
            SCANS[self.preset]["epochs"],
            BinConfig(bin_s=settings.pop("bin_s", BinConfig().bin_s)),
            frames or None,
            dataset=dataset,
            preset=self.preset,
            readout=readout,
            start_rows=SCANS[self.preset]["start_rows"],
            taxels=() if choice == "all" else choose(choice, rows, columns),
        )


class Frontier:
    """Results of all trainings, stored in a file so that a stopped run can continue.

    Parameters
    ----------
    out : Path
        File of the whole result.
    dataset : str, optional
        As for ``open_dataset``.
    """

    def __init__(self, out: Path, dataset: str | None = None) -> None:
        self._dataset = dataset
        self._pieces = Pieces(out, "1")
        self._scans: tuple[str, ScanData] | None = None

    def cell(self, point: Point, fold: int, seed: int, inner: bool = False) -> dict[str, Any]:
        """Return labels, predictions and numbers of the judged images of a training."""
        experiment = point.experiment(self._dataset)
        name = f"{point.name}/{fold}/{seed}{'/inner' * inner}/{_digest(experiment.to_dict())}"
        return self._pieces.of(name, lambda: _train(experiment, self._data(experiment), fold, seed, inner))

    def readout(self, point: Point) -> dict[str, Any]:
        """Return event rate, data rates and power of the readout of a point."""
        experiment = point.experiment(self._dataset)
        fields = experiment.to_dict() | {"network": None, "train": None}
        return self._pieces.of(
            f"rates/{_digest(fields)}",
            lambda: _rates(experiment, self._data(experiment).rate_hz, coded_bps(experiment)),
        )

    def trivial(self, point: Point) -> dict[str, Any]:
        """Return the accuracy of a logistic regression on the mean of every channel."""
        experiment = point.experiment(self._dataset)
        fields = experiment.to_dict() | {"network": None, "train": None}
        return self._pieces.of(f"trivial/{_digest(fields)}", lambda: {"accuracy": _trivial(self._data(experiment))})

    def _data(self, experiment: Experiment) -> ScanData:
        """Return the scans of a point; only those of the last point stay in memory."""
        key = _digest(experiment.to_dict() | {"network": None, "train": None})
        if self._scans is None or self._scans[0] != key:
            self._scans = key, experiment.data()
        return self._scans[1]

    def inner(self, point: Point, folds: int, step: Callable[[], object]) -> dict[str, Any]:
        """Return the inner validation accuracy over folds, from training images only."""
        cells = []
        for fold in range(folds):
            cells.append(self.cell(point, fold, 0, inner=True))
            step()
        rates = self.readout(point)
        right = [np.equal(cell["labels"], cell["predicted"]) for cell in cells]
        accuracy = float(np.mean(right))
        return {"name": point.name, "folds": folds, "bits_per_s": rates["bits_per_s"], "accuracy": accuracy}

    def point(self, point: Point, seeds: int, step: Callable[[], object]) -> dict[str, Any]:
        """Return a point with its accuracy over all folds and a number of seeds."""
        words, labels = [], ""
        for seed in range(seeds):
            cells = []
            for fold in range(FOLDS):
                cells.append(self.cell(point, fold, seed))
                step()
            order = np.argsort(np.concatenate([cell["images"] for cell in cells]))
            labels = as_word(np.concatenate([cell["labels"] for cell in cells])[order])
            words.append(as_word(np.concatenate([cell["predicted"] for cell in cells])[order]))
        rates = {name: value for name, value in self.readout(point).items() if name not in ("name", "code")}
        trivial = {"trivial": self.trivial(point)["accuracy"]}
        return _named(point, point.experiment(self._dataset)) | rates | trivial | _result(labels, words)


def frontier_data(points: Sequence[dict[str, Any]], inner: Sequence[dict[str, Any]] = ()) -> dict[str, Any]:
    """Return the content of ``frontier.json``: points, comparisons of LCS with others, inner validations."""
    order = sorted(points, key=lambda point: (point["preset"] != "physical", point["network"], point["bits_per_s"]))
    return {
        "noise_v": NOISE_V,
        "training": {"networks": NETWORKS, "scans": SCANS},
        "points": order,
        "pairs": pairs_of(order),
        "inner": list(inner),
    }


def points_of(sweep: Sweep, network: str) -> list[dict[str, Any]]:
    """Return the points of a sweep of whole arrays in the form of ``Frontier.point``."""
    found = []
    for point in sweep.points:
        last, coded = point.last, point.coded_bps
        assert last is not None
        assert last.predictions
        assert point.labels
        assert coded
        assert point.rate_hz
        made = Point(str(point.preset), network, re.sub(r"-(?=[\d.])", ":", point.name))
        experiment = made.experiment()
        found.append(
            _named(made, experiment)
            | _rates(experiment, point.rate_hz, coded)
            | _result(point.labels, list(last.predictions))
        )
    return found


def pairs_of(points: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return comparisons of LCS with frames and other encoders at equal scan, network and similar data rate."""
    found = []
    for first in points:
        for second in points:
            same = all(first[name] == second[name] for name in ("preset", "network", "labels"))
            kinds = [point["readout"].partition(":")[0] for point in (first, second)]
            near = max(first["bits_per_s"], second["bits_per_s"]) < AS_EQUAL * min(
                first["bits_per_s"], second["bits_per_s"]
            )
            if same and near and kinds[0] == "lcs" != kinds[1]:
                names = {"first": first["name"], "second": second["name"]}
                result = compare(first["labels"], first["predictions"], second["predictions"])
                found.append(names | dataclasses.asdict(result))
    return found


def _train(experiment: Experiment, data: ScanData, fold: int, seed: int, inner: bool) -> dict[str, Any]:
    """Return the predictions of one network after its last epoch."""
    from eskin.snn.train import predicted_classes, train

    labels = data.image_labels
    judged = stratified_folds(labels, FOLDS, 0)[fold]
    learned = np.setdiff1d(np.arange(len(labels)), judged)
    if inner:
        judged = learned[stratified_folds(labels[learned], INNER_FOLDS, 1)[seed % INNER_FOLDS]]
        learned = np.setdiff1d(learned, judged)
    found = train(Split(data, learned), experiment.network_config(data), experiment.train, seed)
    return {
        "images": judged.tolist(),
        "labels": labels[judged].tolist(),
        "predicted": predicted_classes(found.network, data, judged).tolist(),
        "train_accuracy": found.history[-1].accuracy,
    }


def _trivial(data: ScanData) -> float:
    """Return the cross-validated accuracy of a logistic regression on the mean absolute value of every channel."""
    labels, scans = data.image_labels, data.first_scans(range(len(data.names)))
    columns = np.log(np.abs(data.values[scans].astype(np.float64)).mean(1) + LEAST_RATE)
    right = [
        logistic_classes(columns, labels, np.setdiff1d(np.arange(len(labels)), test), test) == labels[test]
        for test in stratified_folds(labels, FOLDS, 0)
    ]
    return float(np.concatenate(right).mean())


def _named(point: Point, experiment: Experiment) -> dict[str, Any]:
    """Return the names of readout and network of a point, and its taxels."""
    return {
        "name": point.name,
        "readout": point.readout,
        "preset": point.preset,
        "network": point.network,
        "choice": point.taxels,
        "taxels": list(experiment.taxels or range(experiment.readout.taxels)),
    }


def _rates(experiment: Experiment, rate_hz: float, coded: dict[str, float]) -> dict[str, Any]:
    """Return rates and power of a readout; power is None without power equations."""
    config, bits = experiment.scan_and_config()[1], SweepPoint("", experiment).bits_per_event
    power_w = None
    if experiment.frames is not None or experiment.readout.encoding in EQUATIONS:
        even = Rates(rate_hz, rate_hz**2 / config.taxels)
        power_w = power_of(experiment, "consistent", NOISE_V, even)["total"]
    return {
        "rate_hz": rate_hz,
        "bits": bits,
        "bits_per_s": rate_hz * bits,
        "coded_bits_per_s": min(bps for name, bps in coded.items() if name != "addresses"),
        "power_w": power_w,
    }


def _result(labels: str, words: list[str]) -> dict[str, Any]:
    """Return accuracy, interval and predictions over several seeds."""
    right = right_of(labels, words).astype(float)
    return {
        "seeds": len(words),
        "accuracy": float(right.mean()),
        "accuracy_of_seeds": right.mean(1).tolist(),
        "interval": bootstrap(right.T),
        "labels": labels,
        "predictions": words,
    }


def _digest(fields: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(plain(fields), sort_keys=True).encode()).hexdigest()[:12]
