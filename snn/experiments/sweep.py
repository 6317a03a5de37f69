"""Cross-validate many sweep points, resumably, on this machine or a cluster (docs/guide/classifier.md).

The cells of all points run in parallel: all folds of seed 0 of every point, then those of seed 1, and so on. A sweep
that is stopped early therefore has complete seeds of every point.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eskin.base import files
from eskin.base.errors import InputError
from eskin.base.files import write_json
from eskin.base.outputs import check_file
from eskin.base.workers.engine import Batch, Needs, Pool, Shared, Task, sentence, version
from eskin.base.workers.store import Store
from eskin.skin.textures.dataset import open_dataset
from eskin.snn.checkpoint import digest
from eskin.snn.data.coding import events_bps, frames_bps
from eskin.snn.data.folds import check_folds
from eskin.snn.data.frames import codes_of
from eskin.snn.data.record import record
from eskin.snn.data.recordings import event_files, read_recordings
from eskin.snn.data.scans import ScanData
from eskin.snn.experiments.crossval import run_alone, summarise
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.points import READINGS, Point, write_sweep

NEEDS = Needs(("base", "model", "skin", "snn"), ("torch", "numpy"))
"""Packages and libraries that determine the results of trainings."""

PUBLISHED_BPS = 640e3
"""Data rate by which the paper divides its data rates."""

CODED_SCANS = 24
"""Number of scans that are compressed as one stream, evenly spread over the images."""

OnCell = Callable[["PointRun", "dict[str, Any] | None"], object]
"""Function that takes a point and the result of a cell, or None before and after the scans of the point are made."""


@dataclass(frozen=True)
class SweepPoint:
    """One point of a sweep."""

    name: str
    """Name of the point; empty for a single point."""
    experiment: Experiment
    data: ScanData | None = None
    """Scans of the point; None until the first training needs the scans."""


class PointRun:
    """The trainings of one sweep point: finished, missing, and their report.

    ``folder`` takes ``result.json`` when all trainings are done, and ``store`` takes the result of each training. Seeds
    are 0 .. seeds - 1.
    """

    def __init__(self, point: SweepPoint, folder: Path, folds: int, seeds: int, store: Store) -> None:
        if folds < 2:
            raise InputError(f"folds must be at least 2, not {folds}")
        if seeds < 1:
            raise InputError(f"seeds must be at least 1, not {seeds}")
        self.point, self.folder, self.store = point, folder, store
        self.folds, self.seeds = folds, seeds
        self.cells = [(fold, seed) for seed in range(seeds) for fold in range(folds)]
        self.done: dict[tuple[int, int], dict[str, Any]] = {}
        """Results by (fold, seed); existing ones after ``prepare``."""
        self.report: dict[str, Any] | None = None
        """The content of ``result.json``."""
        self.shared: Shared | None = None
        """The scans, from ``prepare`` until all cells are done."""
        self.rate_hz: float | None = None
        self.coded_bps: dict[str, float] | None = None
        self._whole = 0
        self._results: dict[str, Any] = {}
        """Number of completed seeds, and their summary."""
        self._key = point.experiment.to_dict() | {"folds": folds, "fold_seed": 0}
        folder.mkdir(parents=True, exist_ok=True)
        check_file(folder / "result.json")

    @property
    def ready(self) -> bool:
        """True after ``prepare`` was called."""
        return self.rate_hz is not None

    @property
    def accuracy(self) -> float:
        """Mean accuracy of the last epoch over the finished trainings."""
        cells = self.done.values()
        return float(np.mean([np.mean(np.array(c["labels"]) == np.array(c["last"])) for c in cells])) if cells else 0.0

    def prepare(self, tick: Callable[[], object]) -> None:
        """Record the scans and read the stored results; ``tick`` is called after each scan."""
        data = self.point.experiment.data(tick) if self.point.data is None else self.point.data
        check_folds(data, self.folds, self.point.experiment.tests)
        self._key["data"] = digest(data)
        self.done = {cell: self.store[name] for cell in self.cells if (name := self._name(*cell)) in self.store}
        self._images, self._class_names = len(data.names), list(data.class_names)
        self.rate_hz = data.rate_hz
        if self.point.data is None:
            self.coded_bps = coded_bps(self.point.experiment)
        if len(self.done) < len(self.cells):
            self.shared = Shared.of(self._key["data"], data)
        self._conclude()

    def _name(self, fold: int, seed: int) -> str:
        """Return the name of a training in the store: all that determines its result, but the code."""
        return f"{files.digest(files.plain(self._key))} fold {fold} seed {seed}"

    def task(self, fold: int, seed: int) -> Task:
        """Return the task of a training."""
        key = files.digest([self.store.code, self._name(fold, seed)])
        return Task(run_alone, (self.point.experiment, fold, seed, self.folds), self.shared, key, (self, fold, seed))

    def finish(self, result: dict[str, Any]) -> None:
        """Store the result of a training; the last result triggers the report."""
        cell = (result["fold"], result["seed"])
        self.done[cell] = self.store.add(self._name(*cell), result)
        self._conclude()

    def _conclude(self) -> None:
        """Summarise the completed seeds; with all of them, write the report and delete the scans."""
        whole = [s for s in range(self.seeds) if all((fold, s) in self.done for fold in range(self.folds))]
        if len(whole) > self._whole:
            cells = [self.done[fold, s] for s in whole for fold in range(self.folds)]
            self._whole, self._results = len(whole), summarise(cells, self._images, len(self._class_names))
        if len(self.done) < len(self.cells):
            return
        self.shared = None
        self.report = {
            "experiment": self._key,
            "seeds": self.seeds,
            "rate_hz": self.rate_hz,
            "class_names": self._class_names,
            **self._results,
            "cells": [self.done[cell] for cell in self.cells],
        }
        write_json(self.folder / "result.json", self.report)

    def summary(self) -> Point:
        """Return the fields for ``sweep.json``: rates, finished trainings, and accuracies over completed seeds."""
        experiment = self.point.experiment
        data_rate = None if self.rate_hz is None else self.rate_hz * experiment.bits_per_event
        return {
            "name": self.point.name,
            "readout": experiment.kind,
            "resolution": experiment.bits,
            "preset": experiment.preset,
            "rate_hz": self.rate_hz,
            "bits_per_event": experiment.bits_per_event,
            "data_rate_bps": data_rate,
            "normalised_rate": None if data_rate is None else data_rate / PUBLISHED_BPS,
            "class_names": self._class_names if self.ready else None,
            "cells": {"done": len(self.done), "of": len(self.cells), "whole_seeds": self._whole},
            **dict.fromkeys(READINGS),
            **self._results,
            **({"coded_bps": self.coded_bps} if self.coded_bps else {}),
        }


def coded_bps(experiment: Experiment) -> dict[str, float]:
    """Return the compressed bits per second of each form in which ``snn/data/coding.py`` codes events or frames."""
    if experiment.events is not None:
        files = event_files([Path(experiment.events)])
        return events_bps(read_recordings(files[:: -(-len(files) // CODED_SCANS)]))
    scan, config = experiment.scan_and_config()
    textures = open_dataset(experiment.dataset).limit(CODED_SCANS)
    frames = experiment.frames
    if frames is None:
        kind = experiment.variant
        recordings = [record(texture, textures.name, scan, config, variant=kind) for texture in textures]
        return events_bps(recordings, experiment.bins.start_s)
    return frames_bps([codes_of(frames, texture.load(), scan, config) for texture in textures], frames)


def run_points(runs: Sequence[PointRun], pool: Pool, progress: OnCell) -> None:
    """Run all missing trainings of sweep points; each result is stored immediately.

    Raise InputError if a point has no scans or a cell cannot be trained. The running cells are finished first and their
    results stored; no other cell starts.

    - ``runs``: points with equal numbers of folds and seeds.
    - ``pool``: pool for the cells; without effect on the results.
    - ``progress``: called with a point and None before and after its scans are made, and with every cell that was run.
    """
    batch, failures = Batch(pool), list[str]()

    def take(wait: bool = False) -> None:
        for task, result, error in batch.landed(wait):
            run, fold, seed = task.name
            if error is not None:
                if (words := sentence(error)) is None:
                    raise error
                point = f"point {run.point.name}, " if run.point.name else ""
                failures.append(f"{point}fold {fold}, seed {seed}: {words}")
                continue
            shared = run.shared
            run.finish(result)
            if run.shared is None:
                pool.forget(shared.name)
            progress(run, result)

    for seed, run, fold in itertools.product(range(runs[0].seeds), runs, range(runs[0].folds)):
        while batch.full:
            take(wait=True)
        if not run.ready and not failures:
            progress(run, None)
            try:
                run.prepare(take)
            except InputError as error:
                failures.append(f"point {run.point.name}: {error}" if run.point.name else str(error))
            else:
                progress(run, None)
        if failures:
            break
        if (fold, seed) not in run.done:
            batch.start(run.task(fold, seed))
    while batch.flying:
        take(wait=True)
    if failures:
        others = f" ({len(failures) - 1} more failed)" if len(failures) > 1 else ""
        raise InputError(f"{failures[0]}{others}")


def cross_validate(
    experiment: Experiment,
    folder: Path,
    *,
    pool: Pool,
    folds: int = 6,
    seeds: int = 3,
    data: ScanData | None = None,
    progress: Callable[[dict[str, Any]], object] | None = None,
) -> dict[str, Any]:
    """Run all missing cells, and write ``result.json``; return its content.

    - ``folder``: receives the report, and the store of the cells.
    - ``pool``: without effect on the result.
    - ``folds``, ``seeds``: seeds are 0 .. seeds - 1.
    - ``data``: the scans of the experiment, if they are there already.
    - ``progress``: called with every cell, including existing ones.
    """
    folder.mkdir(parents=True, exist_ok=True)
    store = Store(folder / "result.json", version(NEEDS))
    run = PointRun(SweepPoint("", experiment, data), folder, folds, seeds, store)

    def show(_: PointRun, result: dict[str, Any] | None) -> None:
        if progress is not None:
            for cell in [result] if result is not None else run.done.values():
                progress(cell)

    run_points([run], pool, show)
    assert run.report is not None
    return run.report


def sweep(
    points: Sequence[SweepPoint],
    folder: Path,
    *,
    pool: Pool,
    folds: int = 6,
    seeds: int = 3,
    command: str | None = None,
    progress: OnCell | None = None,
) -> list[Point]:
    """Cross-validate every sweep point in a folder of its own, and write ``sweep.json``; return the summaries.

    Raise InputError as ``run_points``.

    - ``folder``: takes ``POINT/result.json``, the store of the cells, and ``sweep.json``, which is up to date after
      every cell.
    - ``pool``, ``progress``: as for ``run_points``.
    - ``command``: stored in ``sweep.json``.
    """
    names = [point.name for point in points]
    if twice := [name for name in names if names.count(name) > 1]:
        raise InputError(f"point {twice[0]} is given twice; leave one out")
    folder.mkdir(parents=True, exist_ok=True)
    store = Store(folder / "sweep.json", version(NEEDS))
    runs = [PointRun(point, folder / point.name, folds, seeds, store) for point in points]

    def note(run: PointRun, result: dict[str, Any] | None) -> None:
        if run.ready:
            write_sweep(folder / "sweep.json", command, [run.summary() for run in runs])
        if progress is not None:
            progress(run, result)

    run_points(runs, pool, note)
    return [run.summary() for run in runs]
