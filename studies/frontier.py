"""Frontier: accuracy against events/s, bits/s and power for readouts of selected taxels.

Inner validation chooses a readout of every encoder, and frames, at every event rate. A stopped run continues with the
missing trainings. If there is a GPU, it trains the convolutional networks of a point together.

Readouts, choices of taxels and networks are combined to points. All points of a network share its training: the same
number of scans, epochs and settings for events and frames. A cell is one fold and seed of a point, or one inner
validation, which trains on 160 of the 200 training images and is judged on the other 40.
"""

from __future__ import annotations

import dataclasses
import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.figures.style import dress, legend_below, new_figure, save_figure
from eskin.base.files import digest
from eskin.base.progress import bar
from eskin.base.workers.engine import Pool, Shared, Task, landing
from eskin.base.workers.store import Store
from eskin.model.config import ReadoutConfig
from eskin.power.readouts import EQUATIONS
from eskin.skin.figures.readouts import look
from eskin.skin.textures.choice import choose
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.folds import inner_part, stratified_folds
from eskin.snn.data.frame_steps import FrameKind
from eskin.snn.data.scans import ScanData, Split
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.intervals import bootstrap
from eskin.snn.experiments.pairs import right_of
from eskin.snn.experiments.points import Sweep, as_word, load_sweep
from eskin.snn.experiments.settings import experiment_of
from eskin.snn.experiments.sweep import NEEDS, coded_bps
from eskin.snn.reference import LEAST_RATE, logistic_classes
from studies.drawing import draw_accuracies
from studies.fig9 import KEPT, NAMES
from studies.networks import Cells, logits_after
from studies.noise_power import Rates, power_of
from studies.study import Data, Result, run, work_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FOLDS = 6

SKIN = (8, 8)
"""Rows and columns of the skin on which taxels are chosen (paper, section II)."""

NOISE_V = 1e-3
"""AFE noise at which power is given: the middle one of the paper's Fig. 6."""

_LEAKY = {"recipe": "tuned", "hidden": 128, "learning_rate": 3e-3}
_LEAKY_2MS = _LEAKY | {"bin_s": 0.002, "shift_steps": 20, "decay": 0.9, "output_decay": 0.975}

NETWORKS: dict[str, dict[str, dict[str, Any]]] = {
    "physical": {
        "leaky": _LEAKY,
        "leaky-2ms": _LEAKY_2MS,
        "leaky-96": _LEAKY_2MS | {"start_rows": 96},
        "leaky-96-dropout": _LEAKY_2MS | {"start_rows": 96, "dropout": 0.1},
        "leaky-96-taxels": _LEAKY_2MS | {"start_rows": 96, "dropout": 0.1, "drop_taxels": 0.1},
        "leaky-96-wide": _LEAKY_2MS | {"start_rows": 96, "hidden": 256},
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

BUDGETS_HZ = (300, 1_000, 2_200, 10_000)
"""Approximate event rates of the readouts that are compared; 2,200 events/s are those of the INTUITIVE chip."""

CANDIDATES: dict[str, dict[str, tuple[str, ...]]] = {
    "physical": {
        "lcs": ("2x1", "2x5 3x2 4x1", "2x12 3x4 4x2", "3x12 4x8 5x4"),
        "cw-lcs": ("2x1", "2x3 3x2 4x1", "2x8 3x4 4x2", "3x12 4x8 5x4"),
        "nlcs": ("2x12 4x3 5x1", "4x11 5x5 6x2", "5x12 6x6 7x3", "7x12 8x7 9x3"),
        "nlcs-bipolar": ("2x1", "2x5 3x2 4x1", "2x12 3x4 4x2", "3x12 4x8 5x4"),
    },
    "paper": {
        "lcs": ("2x7 3x2", "3x7 4x2 5x1", "4x6 5x3 6x1", "3x64 5x12 6x5"),
        "cw-lcs": ("2x7 3x2", "3x7 4x2 5x1", "4x6 5x3 6x1", "3x64 5x12 6x5"),
        "nlcs": ("3x12 5x3 6x1", "5x10 6x5 8x1", "6x11 7x5 9x1", "5x64 8x12 9x6"),
        "nlcs-bipolar": ("2x9 3x2 4x1", "3x9 4x3 5x1", "4x7 5x3 6x1", "3x64 5x12 6x7"),
    },
}
"""Bits and taxels of the encoders' readouts at each budget, by preset: BITSxTAXELS (``Point.lines``)."""

FRAME_RATES_HZ = {0: (31.25, 62.5, 125), 1e3: (125, 250, 500)}
"""Rates of the frames that are tried, from a data rate in bits/s on."""

FRAME_BITS = (3, 4, 5, 6, 7, 8)
"""Bits of the frames that are tried."""

LEVEL_BITS = {3: (2,), 4: (3, 2), 5: (3,), 6: (4, 3), 7: (5, 4), 8: (6, 4)}
"""Levels that are tried for ON/OFF counts of frames, by the bits of a frame."""

LINES = {"physical": "across", "paper": "along"}
"""Direction of a line of taxels in comparison with the scan, by preset."""

COMPARED = {"physical": ("leaky-2ms", "convolutions"), "paper": ("leaky", "convolutions")}
"""Networks that are trained at every budget, by preset."""

INNER = 2
"""Folds of inner validation by which a readout is chosen at a budget."""

SEEDS = {
    ("convolutions", 1_000): 3,
    ("convolutions", 2_200): 3,
    ("leaky-2ms", 2_200): 3,
    ("leaky-96", 2_200): 3,
}
"""Seeds of the chosen readouts, by network and budget; one elsewhere."""

MORE_HEIGHTS: tuple[tuple[int, tuple[str, ...]], ...] = (
    (
        1_000,
        (
            "physical/leaky-96/nlcs-bipolar:2/12x16:across:6",
            "physical/leaky-96/nlcs-bipolar:2/24x8:across:6",
            "physical/leaky-96/nlcs-bipolar:1/24x8:across:22",
            "physical/leaky-96-dropout/nlcs-bipolar:1/24x8:across:22",
            "physical/leaky-96-taxels/nlcs-bipolar:1/24x8:across:22",
            "physical/leaky-96-wide/nlcs-bipolar:1/24x8:across:22",
        ),
    ),
    (2_200, ("physical/leaky-96/nlcs-bipolar:2/12x16:across:12",)),
    (2_200, ("physical/leaky-96/lcs:2/12x16:across:12",)),
    (2_200, ("physical/leaky-96/frame-onoff:250:3:2/12x16:across:12",)),
)
"""Points with more scans of each image, by budget: inner validation chooses one of each list."""

ALSO: dict[str, int] = {
    "physical/leaky-96/nlcs-bipolar:1/24x8:across:22": 1,
    "physical/leaky/lcs:2/12x16:across:12": 3,
    "physical/leaky/frame-onoff:250:3:2/12x16:across:12": 3,
    "physical/leaky-2ms/lcs:2/12x16:across:12": 3,
    "physical/leaky-2ms/frame-onoff:250:3:2/12x16:across:12": 3,
    "physical/convolutions/lcs:3/12x16:across:2": 3,
    "physical/convolutions/frame-diff:250:4/12x16:across:2": 3,
    "paper/convolutions/lcs:5/along:3": 3,
}
"""Seeds of further points, which were chosen earlier and which docs/results/frontier.md compares."""

LEAST_USE = 0.75
"""Part of a data rate that frames use at least."""


PARTS = 20
"""Number of answers during a scan, evenly spread; the last answer uses the whole scan."""

WANTED = 0.97
"""Accuracy that early answers must reach in inner validation."""

TITLES = {
    "leaky": "128 leaky neurons",
    "leaky-2ms": "128 leaky neurons, bins of 2 ms",
    "convolutions": "1-D convolutions",
    "paper": "the paper's network",
}
"""Networks in the figure, in words."""

AXES = {"rate_hz": "events/s", "bits_per_s": "bits/s", "power_w": "power of the readout (W, 1 mV of noise)"}
"""Rows of panels: a field of the points, and its label. Frames have no event rate; some readouts have no power."""

Step = Callable[[], object]
"""Called after each training."""


@dataclass(frozen=True)
class Point:
    """A readout of selected taxels with a network."""

    preset: str
    network: str
    """A key of NETWORKS."""
    readout: str
    """ENCODER:RESOLUTION, or frames as in ``FrameSteps.parse``."""
    taxels: str = "all"
    """``all``, or as in ``eskin.skin.textures.choice.choose``; ``ROWSxCOLUMNS:`` before it names another skin."""

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

    @classmethod
    def lines(cls, preset: str, network: str, readout: str, taxels: int) -> Point:
        """Return the point with a line of taxels on a skin of 12 x 16, or with all 64 taxels of an array of 8 x 8."""
        return cls(preset, network, readout, "all" if taxels == 64 else f"12x16:{LINES[preset]}:{taxels}")

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
        settings = dict(NETWORKS[self.preset][self.network])
        kind, _, number = self.readout.partition(":")
        (rows, columns), choice = self.skin
        readout, frames = ReadoutConfig(rows=rows, columns=columns), self.readout
        scans = {name: settings.pop(name, value) for name, value in SCANS[self.preset].items()}
        if kind not in get_args(FrameKind):
            if not number.isdigit():
                raise InputError(f"a readout must be ENCODER:RESOLUTION or frames, not {self.readout!r}")
            readout, frames = readout.replace(encoding=kind, resolution=int(number)), ""
        return experiment_of(
            settings.pop("recipe"),
            settings,
            scans["epochs"],
            BinConfig(bin_s=settings.pop("bin_s", BinConfig().bin_s)),
            frames or None,
            dataset=dataset,
            preset=self.preset,
            readout=readout,
            start_rows=scans["start_rows"],
            taxels=() if choice == "all" else choose(choice, rows, columns),
        )


def candidates(preset: str, network: str, kind: str, budget_hz: int) -> list[Point]:
    """Return the readouts of an encoder that are tried at a budget."""
    words = CANDIDATES[preset][kind][BUDGETS_HZ.index(budget_hz)].split()
    pairs = [map(int, word.split("x")) for word in words]
    return [Point.lines(preset, network, f"{kind}:{bits}", taxels) for bits, taxels in pairs]


def frame_candidates(preset: str, network: str, bits_per_s: float) -> list[Point]:
    """Return the frames that are tried at a data rate: for each rate those with most taxels and those with most bits.

    Convolutions get differences of frames; spiking networks get ON/OFF counts.
    """
    found: list[Point] = []
    for rate_hz in next(rates for least, rates in reversed(FRAME_RATES_HZ.items()) if bits_per_s >= least):
        fitting = []
        for bits in FRAME_BITS:
            most = int(bits_per_s / (rate_hz * bits))
            taxels = 64 if most >= 64 else min(most, 12)
            if taxels and rate_hz * bits * taxels >= LEAST_USE * bits_per_s:
                fitting.append((bits, taxels))
        for bits, taxels in dict.fromkeys([fitting[0], fitting[-1]]) if fitting else ():
            if network == "convolutions":
                found.append(Point.lines(preset, network, f"frame-diff:{rate_hz:g}:{bits}", taxels))
                continue
            for levels in LEVEL_BITS[bits]:
                readout = f"frame-onoff:{rate_hz:g}:{bits}:{levels}"
                found.append(Point.lines(preset, network, readout.removesuffix(":4"), taxels))
    return found


class Cell(NamedTuple):
    """A training of a point."""

    point: Point
    fold: int
    seed: int
    inner: bool
    """Whether it is judged by inner validation."""


def cells_of(point: Point, seeds: int) -> list[Cell]:
    """Return the trainings of a point for all folds and a number of seeds."""
    return [Cell(point, fold, seed, False) for seed in range(seeds) for fold in range(FOLDS)]


def inner_cells(point: Point, folds: int = INNER) -> list[Cell]:
    """Return the trainings for the inner validation of a point."""
    return [Cell(point, fold, 0, True) for fold in range(folds)]


class Frontier:
    """Results of all trainings, stored so that a stopped run can continue.

    - ``store``: has the results.
    - ``pool``: runs the trainings.
    - ``dataset``: as for ``open_dataset``.
    - ``device``: device name of torch. A GPU trains the convolutional networks of a point together.
    """

    def __init__(self, store: Store, pool: Pool, dataset: str | None = None, device: str = "cpu") -> None:
        self._dataset, self._device = dataset, device
        self._store, self._pool = store, pool
        self._scans: tuple[str, ScanData] | None = None

    def train(self, wanted: Sequence[Cell], step: Step) -> None:
        """Run the missing trainings in parallel, and store their results."""
        missing = {cell: name for cell in dict.fromkeys(wanted) if (name := self._name(cell)) not in self._store}
        for task, made in landing(self._pool, self._tasks(missing)):
            for name, found in zip(task.name, made, strict=True):
                self._store.add(name, found)
                step()
        for _ in range(len(wanted) - len(missing)):
            step()

    def _tasks(self, missing: Mapping[Cell, str]) -> Iterator[Task]:
        """Yield a task for each training; a GPU runs those of a point with convolutions as one task."""
        for (point, inner), cells in itertools.groupby(missing, key=lambda cell: (cell.point, cell.inner)):
            experiment, pairs = point.experiment(self._dataset), [(cell.fold, cell.seed) for cell in cells]
            shared = Shared.of(_scans_digest(experiment), self._data(experiment))
            together = self._device != "cpu" and point.network == "convolutions"
            for part in [pairs] if together else [[pair] for pair in pairs]:
                names = [missing[Cell(point, *pair, inner)] for pair in part]
                key = digest([self._store.code, names])
                yield Task(train_cells, (experiment, part, inner, self._device), shared, key, names)
            self._pool.forget(shared.name)  # all tasks with these scans have started

    def _name(self, cell: Cell) -> str:
        found = digest(cell.point.experiment(self._dataset).to_dict())
        return f"{cell.point.name}/{cell.fold}/{cell.seed}{'/inner' * cell.inner}/{found}"

    def _known(self, cells: Iterable[Cell]) -> list[dict[str, Any]]:
        """Return labels and predictions of the judged images of the trainings that are there."""
        return [self._store[name] for name in map(self._name, cells) if name in self._store]

    def rate_hz(self, experiment: Experiment) -> float:
        """Return the mean event rate of a readout; of frames, values per second."""
        name = f"rate/{_scans_digest(experiment)}"
        return float(self._store.of(name, lambda: self._data(experiment).rate_hz))

    def readout(self, point: Point) -> dict[str, Any]:
        """Return event rate, data rates and power of the readout of a point."""
        experiment = point.experiment(self._dataset)
        found: dict[str, Any] = self._store.of(
            f"rates/{_scans_digest(experiment)}",
            lambda: _rates(experiment, self.rate_hz(experiment), coded_bps(experiment)),
        )
        return found

    def trivial(self, point: Point) -> float:
        """Return the accuracy of a logistic regression on the mean of every channel of the first scans."""
        experiment = dataclasses.replace(point.experiment(self._dataset), start_rows=1)
        name = f"trivial/{_scans_digest(experiment)}"
        return float(self._store.of(name, lambda: trivial_of(experiment.data())))

    def _data(self, experiment: Experiment) -> ScanData:
        """Return the scans of a point; only those of the last point stay in memory."""
        key = _scans_digest(experiment)
        if self._scans is None or self._scans[0] != key:
            self._scans = key, experiment.data()
        return self._scans[1]

    def inner(self, point: Point, folds: int) -> dict[str, Any]:
        """Return the inner validation accuracy over folds, from training images only, after the trainings."""
        cells = self._known(inner_cells(point, folds))
        experiment = point.experiment(self._dataset)
        rate_hz = self.rate_hz(experiment)
        right = [np.equal(cell["labels"], cell["predicted"]) for cell in cells]
        return {
            "name": point.name,
            "folds": folds,
            "rate_hz": rate_hz,
            "bits_per_s": rate_hz * experiment.bits_per_event,
            "accuracy": float(np.mean(right)),
            **{name: float(np.mean([cell[name] for cell in cells])) for name in ("of_scans", "learned")},
        }

    def chosen(self, points: Sequence[Point], step: Step, by: str = "accuracy") -> tuple[Point, list[dict[str, Any]]]:
        """Return the point that is best in inner validation, and the inner validation of all.

        Among equals the point with the lowest data rate is best. ``by`` may be ``of_scans``: the accuracy on all scans
        of the images, not only on the first.
        """
        self.train([cell for point in points for cell in inner_cells(point)], step)
        found = [self.inner(point, INNER) for point in points]
        best = max(range(len(found)), key=lambda n: (found[n][by], -found[n]["bits_per_s"]))
        return points[best], found

    def point(self, point: Point, seeds: int) -> dict[str, Any]:
        """Return a point with its accuracy over all folds and a number of seeds, after the trainings."""
        cells = self._known(cells_of(point, seeds))
        more: dict[str, Any] = {"trivial": self.trivial(point)}
        inner = self._known(inner_cells(point))
        timed, judged = ([cell for cell in found if "answers" in cell] for found in (cells, inner))
        if timed and judged:
            more["latency"] = latency_of(timed, judged)
        return _named(point, point.experiment(self._dataset)) | self.readout(point) | more | result_of(cells)


def measured(run: Frontier, step: Step) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the points of all budgets, and the inner validations by which they were chosen.

    Frames have the data rate of the LCS readout that was chosen at the same budget. If no frames are slow enough, the
    budget has none.
    """
    seeds = {Point.parse(name): number for name, number in ALSO.items()}
    inner: list[dict[str, Any]] = []

    def choose_of(tried: list[Point], budget_hz: int, least: int, by: str = "accuracy") -> dict[str, Any]:
        """Note the inner validations of points, and measure the best one; return its inner validation."""
        point, validated = run.chosen(tried, step, by)
        inner.extend(
            one | {"budget_hz": budget_hz, "chosen": other == point}
            for one, other in zip(validated, tried, strict=True)
        )
        seeds[point] = max(seeds.get(point, 0), least)
        return validated[tried.index(point)]

    for preset, networks in COMPARED.items():
        for network in networks:
            for budget_hz in BUDGETS_HZ:
                bits_per_s = 0.0
                for kind in (*CANDIDATES[preset], "frame"):
                    if kind == "frame":
                        tried = frame_candidates(preset, network, bits_per_s)
                    else:
                        tried = candidates(preset, network, kind, budget_hz)
                    if not tried:  # even the slowest frames need more bits than these events
                        continue
                    best = choose_of(tried, budget_hz, SEEDS.get((network, budget_hz), 1))
                    if kind == "lcs":
                        bits_per_s = best["bits_per_s"]
    for budget_hz, names in MORE_HEIGHTS:
        choose_of([Point.parse(name) for name in names], budget_hz, SEEDS.get(("leaky-96", budget_hz), 1), "of_scans")
    run.train([cell for point, number in seeds.items() for cell in cells_of(point, number)], step)
    return [run.point(point, number) for point, number in seeds.items()], inner


def frontier_data(points: Sequence[dict[str, Any]], inner: Sequence[dict[str, Any]] = ()) -> dict[str, Any]:
    """Return the content of ``frontier.json``: points and inner validations."""
    order = sorted(points, key=lambda point: (point["preset"] != "physical", point["network"], point["bits_per_s"]))
    return {
        "noise_v": NOISE_V,
        "training": {"networks": NETWORKS, "scans": SCANS},
        "points": order,
        "inner": list(inner),
    }


def points_of(sweep: Sweep, network: str) -> list[dict[str, Any]]:
    """Return the points of a sweep of whole arrays in the form of ``Frontier.point``."""
    found = []
    for point in sweep.points:
        made = Point(str(point["preset"]), network, re.sub(r"-(?=[\d.])", ":", point["name"]))
        experiment = made.experiment()
        found.append(
            _named(made, experiment)
            | _rates(experiment, point["rate_hz"], point["coded_bps"])
            | _result(point["labels"], point["last"]["predictions"])
        )
    return found


def judged_of(data: ScanData, fold: int, seed: int, inner: bool) -> tuple[Any, Any]:
    """Return the training images and the judged images of a training."""
    labels = data.image_labels
    judged = stratified_folds(labels, FOLDS, 0)[fold]
    learned = np.setdiff1d(np.arange(len(labels)), judged)
    if inner:
        judged = inner_part(labels, learned, seed)
        learned = np.setdiff1d(learned, judged)
    return learned, judged


def train_cells(
    data: ScanData, experiment: Experiment, trainings: Sequence[tuple[int, int]], inner: bool, device: str
) -> list[dict[str, Any]]:
    """Return the predictions of networks after their last epoch, for pairs of fold and seed.

    ``of_scans`` and, in inner validation, ``learned`` are the accuracies on all scans of the judged and learned images.
    """
    import torch

    from eskin.snn.batched_training import train_together
    from eskin.snn.train import predicted_classes, train

    torch.set_num_threads(1)
    splits = [judged_of(data, fold, seed, inner) for fold, seed in trainings]
    learned, config = [split[0] for split in splits], experiment.network_config(data)
    networks: Sequence[Any]
    if len(trainings) > 1:
        seeds = [seed for _, seed in trainings]
        networks = train_together(data, learned, seeds, config, experiment.train, device)
    else:
        networks = [train(Split(data, learned[0]), config, experiment.train, trainings[0][1], device=device).network]
    found = []
    for network, (own, judged) in zip(networks, splits, strict=True):
        cell = {
            "images": judged.tolist(),
            "labels": data.image_labels[judged].tolist(),
            "predicted": predicted_classes(network.to(device), data, judged, device).tolist(),
            "of_scans": right_scans(network, data, judged, device),
            **course_of(network, data, judged, device),
        }
        if inner:
            cell["learned"] = right_scans(network, data, own, device)
        found.append(cell)
    return found


def right_scans(network: Any, data: ScanData, images: NDArray[np.int64], device: str) -> float:
    """Return the accuracy of a network on all scans of images."""
    from eskin.snn.train import logits_of

    scans = data.scans_of(images)
    return float((logits_of(network, data, scans, device).argmax(1) == data.labels[scans]).mean())


def trivial_of(data: ScanData) -> float:
    """Return the cross-validated accuracy of a logistic regression on the mean absolute value of every channel."""
    labels, scans = data.image_labels, data.first_scans(range(len(data.names)))
    columns = np.log(np.abs(data.values[scans].astype(np.float64)).mean(1) + LEAST_RATE)
    right = [
        logistic_classes(columns, labels, np.setdiff1d(np.arange(len(labels)), test), test) == labels[test]
        for test in stratified_folds(labels, FOLDS, 0)
    ]
    return float(np.concatenate(right).mean())


def _named(point: Point, experiment: Experiment) -> dict[str, Any]:
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
    config = experiment.scan_and_config()[1]
    power_w = None
    if experiment.frames is not None or experiment.readout.encoding in EQUATIONS:
        even = Rates(rate_hz, rate_hz**2 / config.taxels)
        power_w = power_of(experiment, "consistent", NOISE_V, even)["total"]
    return {
        "rate_hz": rate_hz,
        "bits": experiment.bits_per_event,
        "bits_per_s": rate_hz * experiment.bits_per_event,
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


def result_of(cells: Cells) -> dict[str, Any]:
    """Return the result of trainings with all folds of one seed or several, in the order of ``cells_of``."""
    order = np.argsort(np.concatenate([cell["images"] for cell in cells[:FOLDS]]))
    seeds = [cells[at : at + FOLDS] for at in range(0, len(cells), FOLDS)]
    labels = as_word(np.concatenate([cell["labels"] for cell in seeds[0]])[order])
    words = [as_word(np.concatenate([cell["predicted"] for cell in own])[order]) for own in seeds]
    more = {}
    if all("of_scans" in cell for cell in cells):
        more["of_scans"] = float(np.mean([cell["of_scans"] for cell in cells]))
    return more | _result(labels, words)


def _scans_digest(experiment: Experiment) -> str:
    """Return a digest of an experiment without its network and training."""
    return digest(experiment.to_dict() | {"network": None, "train": None})


def course_of(network: Any, data: ScanData, images: NDArray[np.int64], device: str) -> dict[str, Any]:
    """Return the answers of a network at ``PARTS`` times of the first scan of images.

    ``times_s``: seconds from the first step, shape (PARTS,). ``answers``: classes, shape (PARTS, images). ``margin``:
    largest logit minus the next one, same shape, rounded to two digits.
    """
    scans = data.first_scans(images)
    steps = [max(1, round(data.steps * part / PARTS)) for part in range(1, PARTS + 1)]
    logits = np.stack([logits_after(count, network, data, scans, device) for count in steps])
    return answers_over_time(np.array(steps) * data.step_s, logits)


def answers_over_time(times_s: NDArray[np.float64], logits: NDArray[np.floating[Any]]) -> dict[str, Any]:
    """Return times, answers and their margins for logits of shape (PARTS, images, classes)."""
    two = np.sort(logits, 2)[:, :, -2:]
    margin = (two[:, :, 1] - two[:, :, 0]).round(2)
    return {"times_s": times_s.tolist(), "answers": logits.argmax(2).tolist(), "margin": margin.tolist()}


def latency_of(cells: Cells, inner: Cells) -> dict[str, Any]:
    """Return the accuracy of a point over time, and its early answers.

    The network answers as soon as the margin of its answer reaches a threshold, at the latest at the end of the scan.
    The threshold is the one with the earliest answers in inner validation whose accuracy there is at least ``WANTED``.

    ``times_s``, ``accuracy``: shape (PARTS,). ``early``: threshold, mean time and accuracy of the early answers, or
    None if no threshold reaches ``WANTED`` in inner validation.

    - ``cells``, ``inner``: trainings with test images, and with inner validation images alone, with the fields of
      ``answers_over_time``.
    """
    times_s = np.array(cells[0]["times_s"])
    right, margin = _judged(inner)
    fitting = []
    for threshold in [*np.unique(margin).tolist(), float(margin.max()) + 1]:
        first, accuracy = _answered(right, margin, threshold)
        if accuracy >= WANTED:
            fitting.append((float(times_s[first].mean()), threshold))
    right, margin = _judged(cells)
    early = None
    if fitting:
        threshold = min(fitting)[1]
        first, accuracy = _answered(right, margin, threshold)
        early = {"threshold": threshold, "mean_s": float(times_s[first].mean()), "accuracy": accuracy}
    return {"times_s": times_s.tolist(), "accuracy": right.mean(1).tolist(), "early": early}


def _judged(cells: Cells) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Return whether each answer is right, and its margin, shape (PARTS, images of all cells)."""
    right = np.concatenate([np.equal(cell["answers"], cell["labels"]) for cell in cells], 1)
    return right, np.concatenate([np.array(cell["margin"]) for cell in cells], 1)


def _answered(
    right: NDArray[np.bool_], margin: NDArray[np.float64], threshold: float
) -> tuple[NDArray[np.intp], float]:
    """Return the index of the first answer of each image whose margin suffices, else of the last; and the accuracy."""
    enough = margin >= threshold
    enough[-1] = True
    first = enough.argmax(0)
    return first, float(np.take_along_axis(right, first[None], 0).mean())


def kind_of(point: Data) -> str:
    """Return the encoder of a point, or ``frame``."""
    name = str(point["readout"]).partition(":")[0]
    return "frame" if name.startswith("frame") else name


def plot_frontier(data: Data, path: Path) -> None:
    """Plot accuracy against rates and power to a file; see :func:`draw_frontier`."""
    save_figure(draw_frontier(data), path)


def draw_frontier(data: Data) -> Figure:
    """Return a figure of accuracy against event rate, data rate and power, one column per scan and network.

    If inner validation chose readouts, the figure shows only these.
    """
    from matplotlib.lines import Line2D

    chosen = {one["name"] for one in data["inner"] if one["chosen"]}
    points_shown = [
        point for point in data["points"] if point["network"] in TITLES and (not chosen or point["name"] in chosen)
    ]
    of_columns: dict[tuple[str, str], list[Data]] = {}
    for point in points_shown:
        of_columns.setdefault((point["preset"], point["network"]), []).append(point)
    figure = new_figure(1.0 + 3.0 * len(of_columns), 9.0, "Readouts of chosen taxels: accuracy against rate and power")
    grid = figure.subplots(len(AXES), len(of_columns), sharex="row", sharey=True, squeeze=False)
    for row, (field, label) in zip(grid, AXES.items(), strict=True):
        for panel, ((preset, network), points) in zip(row, of_columns.items(), strict=True):
            dress(panel, f"{preset} scan,\n{TITLES[network]}", label, "accuracy (%)" if panel is row[0] else "")
            panel.set_xscale("log")
            panel.set_ylim(20, 102)
            _draw(panel, points, field)
    there = {kind_of(point) for point in points_shown}
    shown = [readout for readout in NAMES if readout in there]
    keys = [Line2D([], [], color=look(r).colour, marker=look(r).marker, ls="") for r in shown]
    remark = "last epoch; bars: 95 % interval over images and seeds"
    legend_below(figure, (keys, [NAMES[r] for r in shown]), len(keys), remark)
    return figure


def _draw(panel: Axes, points: list[Data], field: str) -> None:
    """Draw the points of each readout with intervals, joined in the order of a field."""
    for readout in NAMES:
        own = [p for p in points if kind_of(p) == readout and p[field] and (field, readout) != ("rate_hz", "frame")]
        own.sort(key=lambda point: point[field])
        if not own:
            continue
        style = {"color": look(readout).colour, "marker": look(readout).marker, "linestyle": "-"}
        at = [point[field] for point in own]
        shown = [point | {"bootstrap_95": point["interval"]} for point in own]
        draw_accuracies(panel, at, shown, style, markersize=5, linewidth=1)


def compute(pool: Pool) -> Data:
    """Return the points of all budgets and of the project's sweeps, and the inner validations."""
    import torch

    device = "cuda" if torch.cuda.is_available() else "cpu"
    frontier = Frontier(work_of("frontier", NEEDS), pool, device=device)
    with bar("cells") as step:
        points, inner = measured(frontier, step)
    for name, network in SWEEPS.items():
        points += points_of(load_sweep(KEPT / f"{name}.json"), network)
    return frontier_data(points, inner)


RESULT = Result("frontier", compute, plot_frontier, long=True, needs=NEEDS)

if __name__ == "__main__":
    run("frontier", RESULT)
