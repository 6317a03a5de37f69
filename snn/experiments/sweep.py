"""Cross-validate many sweep points, resumably, on this machine or a cluster (docs/guide/classifier.md).

The cells of all points run in parallel: all folds of seed 0 of every point, then those of seed 1, and so on. A sweep
that is stopped early therefore has complete seeds of every point.
"""

import itertools
import queue
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eskin.base.errors import InputError
from eskin.base.files import write_json
from eskin.base.outputs import check_file
from eskin.base.workers.pool import Local, Shared, WorkerPool, next_result, sentence
from eskin.skin.textures.dataset import open_dataset
from eskin.snn.checkpoint import digest
from eskin.snn.data.coding import events_bps, frames_bps
from eskin.snn.data.folds import check_folds
from eskin.snn.data.frames import codes_of
from eskin.snn.data.record import record
from eskin.snn.data.recordings import event_files, read_recordings
from eskin.snn.data.scans import ScanData
from eskin.snn.experiments.crossval import check_same, read_cell, run_alone, summarise
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.points import READINGS, Point, write_sweep

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

    Raise InputError if the folder contains other files in place of cells, or cells of another experiment.

    ``folder`` takes one file per cell, and ``result.json`` when all are done. Seeds are 0 .. seeds - 1.
    """

    def __init__(self, point: SweepPoint, folder: Path, folds: int, seeds: int) -> None:
        if folds < 2:
            raise InputError(f"folds must be at least 2, not {folds}")
        if seeds < 1:
            raise InputError(f"seeds must be at least 1, not {seeds}")
        self.point, self.folder = point, folder
        self.folds, self.seeds = folds, seeds
        self.paths = {(fold, s): folder / f"fold-{fold}-seed-{s}.json" for s in range(seeds) for fold in range(folds)}
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
        self._found = {cell: read_cell(path) for cell, path in self.paths.items() if path.exists()}
        for cell, (key, _) in self._found.items():
            check_same(self.paths[cell], key, self._key)
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
        for cell, (key, result) in self._found.items():
            check_same(self.paths[cell], key, self._key)
            self.done[cell] = result
        self._found = {}
        self._images, self._class_names = len(data.names), list(data.class_names)
        self.rate_hz = data.rate_hz
        if self.point.data is None:
            self.coded_bps = coded_bps(self.point.experiment)
        if len(self.done) < len(self.paths):
            self.shared = Shared.of(self.point.name, data)
        self._conclude()

    def finish(self, result: dict[str, Any]) -> None:
        """Store the result of a training; the last result triggers the report."""
        cell = (result["fold"], result["seed"])
        write_json(self.paths[cell], {"experiment": self._key, "result": result})
        self.done[cell] = result
        self._conclude()

    def _conclude(self) -> None:
        """Summarise the completed seeds; with all of them, write the report and delete the scans."""
        whole = [s for s in range(self.seeds) if all((fold, s) in self.done for fold in range(self.folds))]
        if len(whole) > self._whole:
            cells = [self.done[fold, s] for s in whole for fold in range(self.folds)]
            self._whole, self._results = len(whole), summarise(cells, self._images, len(self._class_names))
        if len(self.done) < len(self.paths):
            return
        self.shared = None
        self.report = {
            "experiment": self._key,
            "seeds": self.seeds,
            "rate_hz": self.rate_hz,
            "class_names": self._class_names,
            **self._results,
            "cells": [self.done[cell] for cell in self.paths],
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
            "cells": {"done": len(self.done), "of": len(self.paths), "whole_seeds": self._whole},
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


def run_points(runs: Sequence[PointRun], pool: WorkerPool, progress: OnCell) -> None:
    """Run all missing trainings of sweep points; each result is stored immediately.

    Raise InputError if a point has no scans or a cell cannot be trained. The running cells are finished first and their
    results stored; no other cell starts.

    - ``runs``: points with equal numbers of folds and seeds.
    - ``pool``: pool for the cells; without effect on the results.
    - ``progress``: called with a point and None before and after its scans are made, and with every cell that was run.
    """
    landed: queue.SimpleQueue[tuple[PointRun, int, int, Any]] = queue.SimpleQueue()
    failures: list[str] = []
    flying = 0

    def take(run: PointRun, fold: int, seed: int, future: Any) -> None:
        nonlocal flying
        flying -= 1
        try:
            result = future.result()
        except Exception as error:
            if (words := sentence(error)) is None:
                raise
            point = f"point {run.point.name}, " if run.point.name else ""
            failures.append(f"{point}fold {fold}, seed {seed}: {words}")
            return
        run.finish(result)
        if run.report is not None:
            pool.forget(run.point.name)
        progress(run, result)

    def take_those_there() -> None:
        while not landed.empty():
            take(*landed.get())

    for seed, run, fold in itertools.product(range(runs[0].seeds), runs, range(runs[0].folds)):
        while flying >= pool.window:
            take(*next_result(landed, pool))
        if not run.ready and not failures:
            progress(run, None)
            try:
                run.prepare(take_those_there)
            except InputError as error:
                failures.append(f"point {run.point.name}: {error}" if run.point.name else str(error))
            else:
                progress(run, None)
        if failures:
            break
        if (fold, seed) not in run.done:
            future = pool.submit(run_alone, run.point.experiment, fold, seed, run.folds, shared=run.shared)
            flying += 1
            future.add_done_callback(lambda done, cell=(run, fold, seed): landed.put((*cell, done)))
    while flying:
        take(*next_result(landed, pool))
    if failures:
        others = f" ({len(failures) - 1} more failed)" if len(failures) > 1 else ""
        raise InputError(f"{failures[0]}{others}")


def cross_validate(
    experiment: Experiment,
    folder: Path,
    *,
    folds: int = 6,
    seeds: int = 3,
    workers: int | None = 1,
    data: ScanData | None = None,
    progress: Callable[[dict[str, Any]], object] | None = None,
) -> dict[str, Any]:
    """Run the missing trainings of one sweep point, and write ``result.json``; return its content.

    Raise InputError if the folder contains cells of another experiment.

    - ``folder``: receives a file per fold and seed, and the report.
    - ``folds``, ``seeds``: seeds are 0 .. seeds - 1.
    - ``workers``: processes of one thread each, by default as many as cores; the result does not depend on it.
    - ``data``: the scans of the experiment, if they are there already.
    - ``progress``: called with every cell, including existing ones.
    """
    run = PointRun(SweepPoint("", experiment, data), folder, folds, seeds)

    def show(_: PointRun, result: dict[str, Any] | None) -> None:
        if progress is not None:
            for cell in [result] if result is not None else run.done.values():
                progress(cell)

    with Local(workers) as pool:
        run_points([run], pool, show)
    assert run.report is not None
    return run.report


def sweep(
    points: Sequence[SweepPoint],
    folder: Path,
    *,
    pool: WorkerPool,
    folds: int = 6,
    seeds: int = 3,
    command: str | None = None,
    progress: OnCell | None = None,
) -> list[Point]:
    """Cross-validate every sweep point in a folder of its own, and write ``sweep.json``; return the summaries.

    Raise InputError as ``run_points``, and if a folder contains cells of another experiment.

    - ``folder``: takes ``POINT/fold-F-seed-S.json``, ``POINT/result.json`` and ``sweep.json``, which is up to date
      after every cell.
    - ``pool``, ``progress``: as for ``run_points``.
    - ``command``: stored in ``sweep.json``.
    """
    names = [point.name for point in points]
    if twice := [name for name in names if names.count(name) > 1]:
        raise InputError(f"point {twice[0]} is given twice; leave one out")
    runs = [PointRun(point, folder / point.name, folds, seeds) for point in points]
    check_file(folder / "sweep.json")

    def note(run: PointRun, result: dict[str, Any] | None) -> None:
        if run.ready:
            write_sweep(folder / "sweep.json", command, [run.summary() for run in runs])
        if progress is not None:
            progress(run, result)

    run_points(runs, pool, note)
    return [run.summary() for run in runs]
