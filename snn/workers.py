"""Where the cells of a sweep are run: in this process, in processes of this machine, or on a Dask cluster.

All give the same results: a cell is one call of ``work`` with one torch thread, and never two at once in a process.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import hashlib
import logging
import multiprocessing
import os
import pickle
import signal
import threading
import uuid
import warnings
import zlib
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

import model
import snn
from model.errors import InputError
from snn.crossval import run_cell
from snn.dataset import ScanData
from snn.experiment import Experiment

SPARE = 2
"""So many cells wait behind those that run, and keep the workers busy while the next point is recorded."""

CONNECT_S, WORKERS_S = 5.0, 10.0
"""Seconds that a scheduler may take to answer, and its first worker to appear."""

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


# -- this machine ------------------------------------------------------------------------------------


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


# -- a Dask cluster ----------------------------------------------------------------------------------


def version() -> str:
    """Return a text that differs where this project or the libraries that compute do."""
    import numpy
    import torch

    found = hashlib.sha256()
    for package in (snn, model):
        folder = Path(str(package.__file__)).parent
        for path in sorted([*folder.glob("*.py"), *folder.glob("*.cpp")]):
            found.update(f"{folder.name}/{path.name}\0".encode() + path.read_bytes() + b"\0")
    return f"{found.hexdigest()[:16]}, torch {torch.__version__}, numpy {numpy.__version__}"


class Cluster:
    """The workers of a Dask scheduler, each of one thread.

    The scans of a point are the result of a task of their own, so that Dask can make them again where a worker died.

    Parameters
    ----------
    address : str
        As ``distributed.Client`` takes it: tcp://HOST:PORT.

    Raises
    ------
    InputError
        If the scheduler does not answer, has no worker, or a worker cannot compute what this machine would.
    """

    def __init__(self, address: str) -> None:
        import distributed

        self.address = address
        self._version = version()
        self._scans: dict[str, Any] = {}
        self._cells: dict[Any, Any] = {}
        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # else a lost connection is a page of text
        warnings.filterwarnings("ignore", message="Sending large graph")  # the scans, once for each point
        try:
            asyncio.run(_find_scheduler(address))
        except Exception:  # whatever else may answer there, or be wrong with the address
            raise InputError(
                f"no Dask scheduler answers at {address or 'an empty address'}; start one with dask scheduler and give "
                f"its address, as --scheduler tcp://HOST:8786"
            ) from None
        self._client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
        try:
            self._check_workers()
        except BaseException:
            self._client.close()
            raise

    def _check_workers(self) -> None:
        """Refuse a cluster without workers, and workers that would compute something else."""
        try:
            self._client.wait_for_workers(1, timeout=WORKERS_S)
        except TimeoutError:
            raise InputError(
                f"the scheduler {self.address} has no workers; start some with dask worker {self.address} --nthreads 1"
            ) from None

        def identify() -> str:  # inside, so that it travels by value: the worker may not have this module
            import importlib

            return str(importlib.import_module("snn.workers").version())

        for worker, found in self._client.run(identify, on_error="return").items():
            if isinstance(found, BaseException):
                raise InputError(
                    f"worker {worker} cannot load this project ({found}); start it in the project's folder, with the "
                    f"project's Python"
                )
            _check_version(found, self._version, f"worker {worker}")
        for worker, threads in self._client.nthreads().items():
            if threads != 1:
                raise InputError(
                    f"worker {worker} has {threads} threads, but only one network can be trained in a process; "
                    f"start it with --nthreads 1 and more --nworkers"
                )

    @property
    def window(self) -> int:
        """The workers of this moment, and some cells to wait behind."""
        return len(self._client.scheduler_info()["workers"]) + SPARE

    def submit(self, point: str, packed: bytes, experiment: Experiment, *cell: int) -> Any:
        """Start one cell on the cluster."""
        unique = uuid.uuid4().hex
        if point not in self._scans:
            self._scans[point] = self._client.submit(unpack, packed, key=f"scans {point}-{unique}")
        future = self._client.submit(
            _work_checked, self._version, experiment, self._scans[point], *cell, key=f"cell {point}-{unique}"
        )
        self._cells[future.key] = future
        future.add_done_callback(lambda done: self._cells.pop(done.key, None))
        return future

    def forget(self, point: str) -> None:
        """Let the workers drop the scans of a point."""
        self._scans.pop(point, None)

    def check(self) -> None:
        """Refuse to wait for a scheduler that went away."""
        if self._client.status != "running":
            raise InputError(f"the scheduler {self.address} went away; the same command goes on with the cells left")

    def __enter__(self) -> Cluster:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with contextlib.suppress(OSError):
            self._client.cancel(list(self._cells.values()))
        self._client.close()


async def _find_scheduler(address: str) -> None:
    """Ask who is there; a Client that finds nobody would take half a minute to close."""
    from distributed import Security
    from distributed.comm import connect
    from distributed.core import send_recv

    async with asyncio.timeout(CONNECT_S):
        comm = await connect(address, timeout=CONNECT_S, **Security().get_connection_args("client"))
        try:
            identity = await send_recv(comm, op="identity", n_workers=0)
        finally:
            comm.abort()
    if identity["type"] != "Scheduler":
        raise ValueError(f"{address} is a {identity['type']}")


def _check_version(found: str, wanted: str, where: str) -> None:
    if found != wanted:
        raise InputError(
            f"{where} has another version of this project or its libraries ({found}; here {wanted}); "
            f"install the same on both and start the worker again"
        )


def _work_checked(wanted: str, experiment: Experiment, data: ScanData, *cell: int) -> dict[str, Any]:
    """Run a cell on a worker, which may have come after the others were checked."""
    from distributed import get_worker

    _check_version(_own_version(), wanted, f"worker {get_worker().address}")
    return work(experiment, data, *cell)


_own_version = functools.cache(version)


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
