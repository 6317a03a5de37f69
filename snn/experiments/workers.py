"""Where the cells of a sweep run: in this process, in processes of this machine, or on a Dask cluster (``cluster``).

All give the same results: a cell is one call of ``work`` with one torch thread, and never two at once in a process.
"""

from __future__ import annotations

import functools
import multiprocessing
import os
import pickle
import signal
import threading
import zlib
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from types import TracebackType
from typing import Any, Protocol

from model.errors import InputError
from snn.data.scans import ScanData
from snn.experiments.crossval import run_cell
from snn.experiments.experiment import Experiment

SPARE = 2
"""So many cells wait behind those that run, and keep the workers busy while the next point is recorded."""


_one_at_a_time = threading.Lock()


class Crew(Protocol):
    """Takes cells and gives futures with ``add_done_callback`` and ``result``; leaving it stops what still runs."""

    @property
    def window(self) -> int:
        """So many cells are worth having on their way."""

    def submit(self, point: str, packed: bytes, experiment: Experiment, *cell: int) -> Any:
        """Start one cell; the arguments but ``point`` are those of ``work``."""

    def forget(self, point: str) -> None:
        """Let the scans of a point go: no cell of it will come."""

    def check(self) -> None:
        """Refuse to wait longer if no result can come any more."""

    def __enter__(self) -> Crew: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


def work(experiment: Experiment, data: ScanData, fold: int, seed: int, folds: int, fold_seed: int) -> dict[str, Any]:
    """Return the result of a cell, trained by one thread.

    Two threads on a shared machine can be far slower than one, and dropout draws from a generator that all cells of
    a process share.
    """
    import torch

    with _one_at_a_time:
        torch.set_num_threads(1)
        return run_cell(experiment, data, fold, seed, folds, fold_seed)


def pack(data: ScanData) -> bytes:
    """Return scans in a few megabytes."""
    return zlib.compress(pickle.dumps(data, protocol=5), 1)


def unpack(packed: bytes) -> ScanData:
    """Return the scans that ``pack`` took."""
    data: ScanData = pickle.loads(zlib.decompress(packed))
    return data


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Local:
    """Processes of this machine; one worker is this process itself.

    Parameters
    ----------
    workers : int or None
        One per core that this process may use by default.
    """

    def __init__(self, workers: int | None = None) -> None:
        workers = cores() if workers is None else workers
        if workers < 1:
            raise InputError(f"workers must be at least 1, not {workers}")
        self.window = workers + SPARE if workers > 1 else 1
        self._others = set(multiprocessing.active_children())
        self._pool = None
        if workers > 1:
            self._pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), _start)

    def submit(self, point: str, packed: bytes, experiment: Experiment, *cell: int) -> Future[dict[str, Any]]:
        """Start one cell in a process, or run it here."""
        if self._pool is not None:
            return self._pool.submit(_work_packed, experiment, packed, *cell)
        future: Future[dict[str, Any]] = Future()
        try:
            future.set_result(_work_packed(experiment, packed, *cell))
        except InputError as error:
            future.set_exception(error)
        return future

    def forget(self, point: str) -> None:
        """Nothing is kept by point: a process keeps the scans of its latest two."""

    def check(self) -> None:
        """A process that dies fails its cells at once."""

    def __enter__(self) -> Local:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._pool is None:
            return
        if kind is not None:
            for child in set(multiprocessing.active_children()) - self._others:
                child.terminate()
        self._pool.shutdown(cancel_futures=True)


def _start() -> None:
    """Leave Ctrl-C to the first process, and end with it, even if it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None
    threading.Thread(target=_end_with, args=[parent.join], daemon=True).start()


def _end_with(wait: Callable[[], None]) -> None:
    wait()
    os._exit(1)


@functools.lru_cache(maxsize=2)
def _unpacked(packed: bytes) -> ScanData:
    return unpack(packed)


def _work_packed(experiment: Experiment, packed: bytes, *cell: int) -> dict[str, Any]:
    return work(experiment, _unpacked(packed), *cell)


def sentence(error: BaseException) -> str | None:
    """Return what a user is told of a failed cell; None if the error is a defect of the program."""
    if isinstance(error, InputError):
        return str(error)
    if isinstance(error, BrokenProcessPool):
        return "a worker process died, perhaps for want of memory; take fewer --workers"
    if type(error).__name__ == "KilledWorker":
        return "the workers that ran it died, one after the other, perhaps for want of memory"
    if type(error).__name__ == "FutureCancelledError":
        return "the scheduler lost it; the same command runs it again"
    return None
