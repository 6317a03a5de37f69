"""Run tasks in this process, in local threads or processes, or on a Dask cluster (``cluster``).

A piece of work is one call of a function that a process can find by module and name. Results depend only on the
arguments, so all pools give equal results. If a process dies, its work is repeated.
"""

from __future__ import annotations

import functools
import multiprocessing
import os
import pickle
import queue
import signal
import threading
import zlib
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any

from eskin.base.errors import InputError
from eskin.base.workers.garbage import collect_seldom

SPARE = 2  # tasks that wait in a queue and keep the workers busy
MAX_DEATHS = 3  # repetitions of a task after a process died; Dask allows as many


@dataclass(frozen=True)
class Shared:
    """A pickled value that many tasks share; a pool stores it under its name."""

    name: str
    packed: bytes

    @classmethod
    def of(cls, name: str, value: Any) -> Shared:
        """Return a value pickled under a name."""
        return cls(name, zlib.compress(pickle.dumps(value, protocol=5), 1))


def unpack(packed: bytes) -> Any:
    """Return the value pickled by ``Shared.of``."""
    return pickle.loads(zlib.decompress(packed))


class WorkerPool(AbstractContextManager["WorkerPool"]):
    """Interface of a worker pool: submit tasks and receive futures."""

    @property
    @abstractmethod
    def workers(self) -> int:
        """Number of tasks computed in parallel."""

    @property
    @abstractmethod
    def window(self) -> int:
        """Number of tasks to keep submitted."""

    @abstractmethod
    def submit(self, work: Callable[..., Any], *arguments: Any, shared: Shared | None = None) -> Any:
        """Submit ``work`` and return its future; a shared value becomes the first argument."""

    def forget(self, name: str) -> None:  # nothing by default: local processes cache few values
        """Delete a shared value that no further task needs."""

    def check(self) -> None:  # nothing by default: the death of a local process is noticed immediately
        """Raise an error if no further result can arrive."""


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass
class _Piece:
    """A task, and the number of processes that died while computing it."""

    call: tuple[Callable[..., Any], bytes | None, tuple[Any, ...]]
    future: Future[Any] = field(default_factory=Future)
    deaths: int = 0


class Local(WorkerPool):
    """Worker pool on this machine, by default with one worker for each core that this process may use.

    Threads are for work that releases the interpreter lock: compiled loops, simulators. Other work needs processes.
    """

    workers = window = 0

    def __init__(self, workers: int | None = None, threads: bool = False) -> None:
        workers = cores() if workers is None else workers
        if workers < 1:
            raise InputError(f"workers must be at least 1, not {workers}")
        self.window = workers + SPARE if workers > 1 else 1
        self.workers, self._threads = workers, threads
        self._others = set(multiprocessing.active_children())
        self._left = False
        self._renewing = threading.Lock()
        self._pool = self._new_pool() if workers > 1 else None

    def _new_pool(self) -> ProcessPoolExecutor | ThreadPoolExecutor:
        if self._threads:
            return ThreadPoolExecutor(self.workers)
        return ProcessPoolExecutor(self.workers, multiprocessing.get_context("spawn"), _start)

    def submit(self, work: Callable[..., Any], *arguments: Any, shared: Shared | None = None) -> Future[Any]:
        """Submit a task to the pool, or compute it in this process."""
        piece = _Piece((work, None if shared is None else shared.packed, arguments))
        if self._pool is not None:
            self._begin(piece)
            return piece.future
        try:
            piece.future.set_result(_call(*piece.call))
        except Exception as error:
            piece.future.set_exception(error)
        return piece.future

    def _begin(self, piece: _Piece) -> None:
        """Send a task to the pool; if the pool is broken, queue the task for a new pool."""
        pool = self._pool
        assert pool is not None
        try:
            running = pool.submit(_call, *piece.call)
        except BrokenProcessPool:
            self._renew(pool)
            self._begin(piece)
            return
        running.add_done_callback(lambda done: self._end(piece, pool, done))

    def _end(self, piece: _Piece, pool: ProcessPoolExecutor | ThreadPoolExecutor, done: Future[Any]) -> None:
        """Deliver the result of a task, or restart the task after its process died."""
        if done.cancelled():
            piece.future.cancel()
            return
        error = done.exception()
        if isinstance(error, BrokenProcessPool) and not self._left and piece.deaths < MAX_DEATHS:
            piece.deaths += 1
            self._renew(pool)
            self._begin(piece)
        elif error is not None:
            piece.future.set_exception(error)
        else:
            piece.future.set_result(done.result())

    def _renew(self, broken: ProcessPoolExecutor | ThreadPoolExecutor) -> None:
        with self._renewing:
            if self._pool is broken:
                self._pool = self._new_pool()

    def __exit__(self, kind: type[BaseException] | None, *where: Any) -> None:
        self._left = True
        if self._pool is None:
            return
        if kind is not None:
            for child in set(multiprocessing.active_children()) - self._others:
                child.terminate()
        self._pool.shutdown(cancel_futures=True)


def _start() -> None:
    """Ignore Ctrl-C in this child process, and exit with the parent process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    collect_seldom()
    parent = multiprocessing.parent_process()
    assert parent is not None

    def end() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()


_unpacked = functools.lru_cache(maxsize=2)(unpack)


def _call(work: Callable[..., Any], packed: bytes | None, arguments: tuple[Any, ...]) -> Any:
    return work(*arguments) if packed is None else work(_unpacked(packed), *arguments)


def next_result(landed: queue.SimpleQueue[Any], pool: WorkerPool) -> Any:
    """Return the next item of a queue filled by callbacks; raise an error if no result can arrive."""
    while True:
        try:
            return landed.get(timeout=1.0)
        except queue.Empty:
            pool.check()


def each(
    pool: WorkerPool, work: Callable[..., Any], jobs: Iterable[tuple[Any, ...]], shared: Shared | None = None
) -> Iterator[Any]:
    """Yield the results of a function for all jobs, in order.

    The arguments of a call are taken from ``jobs`` when the call is due. Raises InputError if work refuses its input,
    or no worker is left.
    """
    landed: queue.SimpleQueue[tuple[int, Any]] = queue.SimpleQueue()
    made: dict[int, Any] = {}
    coming = enumerate(jobs)
    flying = wanted = 0
    more = True
    while True:
        while more and flying < pool.window:
            number, job = next(coming, (-1, ()))
            if more := number >= 0:
                future = pool.submit(work, *job, shared=shared)
                future.add_done_callback(lambda done, number=number: landed.put((number, done)))
                flying += 1
        if not flying:
            return
        number, done = next_result(landed, pool)
        flying -= 1
        made[number] = _result(done)
        while wanted in made:
            yield made.pop(wanted)
            wanted += 1


def _result(future: Any) -> Any:
    try:
        return future.result()
    except Exception as error:
        words = sentence(error)
        if words is None:
            raise
        raise InputError(words) from None


def sentence(error: BaseException) -> str | None:
    """Return the error message for the user for a failed task; None for a program error."""
    if isinstance(error, InputError):
        return str(error)
    if isinstance(error, BrokenProcessPool):
        return "a worker process died, perhaps from lack of memory; use fewer --workers"
    if type(error).__name__ == "KilledWorker":
        return "the workers that ran it died, one after the other, perhaps from lack of memory"
    if type(error).__name__ == "FutureCancelledError":
        return "the scheduler lost the work; the same command repeats it"
    return None
