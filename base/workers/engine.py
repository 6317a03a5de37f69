"""Run tasks in this process, in local threads or processes, or on the workers of a Dask scheduler.

A task is one call of a function that a process can find by module and name. Its result depends only on its arguments,
so all pools give equal results. If a worker dies, its task is repeated.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import hashlib
import importlib
import importlib.metadata
import itertools
import logging
import multiprocessing
import os
import pickle
import queue
import signal
import threading
import uuid
import warnings
import zlib
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import digest
from eskin.base.workers.garbage import collect_seldom
from eskin.base.workers.store import Store

SPARE = 2  # tasks that wait in a queue and keep the workers busy
MAX_DEATHS = 3  # repetitions of a task after a process died; Dask allows as many
SOURCES = ("*.py", "*.cpp", "*.v", "*.sv", "*.toml", "*.rdl", "*.json")
"""Files of a package that determine results: code, properties and points, waivers, registers, rates."""

CONNECT_S, WORKERS_S = 5.0, 10.0
"""Time limits in seconds for the answer of a scheduler, and for its first worker."""


@dataclass(frozen=True)
class Shared:
    """A pickled value that many tasks share; a pool stores it under its name."""

    name: str  # for tasks with a key: a digest of the value, which two runs on a cluster share too
    packed: bytes

    @classmethod
    def of(cls, name: str, value: Any) -> Shared:
        """Return a value pickled under a name."""
        return cls(name, zlib.compress(pickle.dumps(value, protocol=5), 1))


def unpack(packed: bytes) -> Any:
    """Return the value pickled by ``Shared.of``."""
    return pickle.loads(zlib.decompress(packed))


@dataclass
class Task:
    """One call of a function; a shared value becomes the first argument."""

    work: Callable[..., Any]
    arguments: tuple[Any, ...]
    shared: Shared | None = None
    key: str = ""  # digest of everything that determines the result: two runs on a cluster compute it once
    name: Any = None  # the caller's own name for it
    deaths: int = 0  # processes that died while computing it


@dataclass(frozen=True)
class Needs:
    """Packages and libraries that determine the results of tasks, and are equal in a worker and in this process."""

    packages: tuple[str, ...] = ("base", "model", "skin", "power")
    libraries: tuple[str, ...] = ("numpy", "scipy", "numba")


@functools.cache
def version(needs: Needs) -> str:
    """Return a text that identifies the versions of this project's sources and of libraries."""
    found = hashlib.sha256()
    for package in needs.packages:
        folder = Path(str(importlib.import_module(f"eskin.{package}").__file__)).parent
        for path in sorted(path for kind in SOURCES for path in folder.rglob(kind)):
            found.update(f"{path.relative_to(folder.parent)}\0".encode() + path.read_bytes() + b"\0")
    versions = [f"{name} {importlib.metadata.version(name)}" for name in needs.libraries]
    return ", ".join([found.hexdigest()[:16], *versions])


class Pool(AbstractContextManager["Pool"]):
    """Interface of the workers."""

    @property
    @abstractmethod
    def workers(self) -> int:
        """Number of tasks computed in parallel, at least one."""

    @property
    def window(self) -> int:
        """Number of tasks to keep submitted: one for each worker, plus a short queue."""
        return self.workers + SPARE

    @abstractmethod
    def submit(self, task: Task) -> Any:
        """Start a task and return its future."""

    def forget(self, name: str) -> None:  # nothing by default: local processes cache few values
        """Delete a shared value that no further task needs."""

    def check(self) -> None:  # nothing by default: the death of a local process is noticed immediately
        """Raise an error if no further result can arrive."""


def open_pool(workers: int | None, scheduler: str | None, needs: Needs | None = None, *, threads: bool = False) -> Pool:
    """Return the pool for the options --workers and --scheduler.

    Workers of a Dask scheduler must share the versions of ``needs``, by default those of the model. On this machine,
    threads instead of processes are for work that releases the interpreter lock.
    """
    if scheduler is None:
        return Local(workers, threads)
    if workers is not None:
        raise InputError(
            "--workers starts processes on this machine, --scheduler uses a cluster; give only one of these options"
        )
    return Cluster(scheduler, needs or Needs())


# -- workers on this machine -------------------------------------------------------------------------


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Local(Pool):
    """Workers on this machine, by default one for each core that this process may use.

    Threads are for work that releases the interpreter lock: compiled loops, simulators. Other work needs processes. The
    first process answers 0.4 s after the start, where a local cluster of Dask takes 5 s.
    """

    workers = 0

    def __init__(self, workers: int | None = None, threads: bool = False) -> None:
        self.workers = cores() if workers is None else workers
        if self.workers < 1:
            raise InputError(f"workers must be at least 1, not {workers}")
        self._threads, self._others = threads, set(multiprocessing.active_children())
        self._executor = self._new_executor()

    def _new_executor(self) -> Executor:
        if self.workers == 1:
            return _Here()
        if self._threads:
            return ThreadPoolExecutor(self.workers)
        return ProcessPoolExecutor(self.workers, multiprocessing.get_context("spawn"), _start)

    @property
    def window(self) -> int:
        """Number of tasks to keep submitted; a single worker computes each task when it is submitted."""
        return self.workers + SPARE if self.workers > 1 else 1

    def submit(self, task: Task) -> Future[Any]:
        """Start a task, in new processes if one of the old ones died."""
        call = (task.work, None if task.shared is None else task.shared.packed, task.arguments)
        try:
            return self._executor.submit(_call, *call)
        except BrokenProcessPool:
            self._executor = self._new_executor()
            return self._executor.submit(_call, *call)

    def __exit__(self, kind: type[BaseException] | None, *where: Any) -> None:
        if kind is not None:
            for child in set(multiprocessing.active_children()) - self._others:
                child.terminate()
        self._executor.shutdown(cancel_futures=True)


class _Here(Executor):
    """This process, as an executor."""

    def submit(self, work: Callable[..., Any], /, *arguments: Any, **_: Any) -> Future[Any]:
        done: Future[Any] = Future()
        try:
            done.set_result(work(*arguments))
        except Exception as error:
            done.set_exception(error)
        return done


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


# -- workers of a Dask scheduler ---------------------------------------------------------------------


class Cluster(Pool):
    """The workers of a Dask scheduler, each with one thread.

    A shared value is the result of its own task, so that Dask can make it again after a worker died. The address is
    tcp://HOST:PORT. Raises InputError if the scheduler does not answer, has no worker, or a worker has other versions.
    """

    def __init__(self, address: str, needs: Needs) -> None:
        import distributed

        self.address, self.needs = address, needs
        self._version = version(needs)
        self._shared: dict[str, Any] = {}
        self._started: dict[Any, Any] = {}
        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # otherwise a lost connection prints a page of text
        warnings.filterwarnings("ignore", message="Sending large graph")  # a shared value is sent only once
        try:
            asyncio.run(_find_scheduler(address))
        except Exception:  # any other answer, or a wrong address
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
        """Check that the cluster has workers, and that all of them have the right versions."""
        try:
            self._client.wait_for_workers(1, timeout=WORKERS_S)
        except TimeoutError:
            raise InputError(
                f"the scheduler {self.address} has no workers; start some with dask worker {self.address} --nthreads 1"
            ) from None

        packages, libraries = self.needs.packages, self.needs.libraries

        def identify() -> str:  # nested, so that Dask sends its code: the worker may not have this module
            import importlib

            module = importlib.import_module("eskin.base.workers.engine")
            return str(module.version(module.Needs(packages, libraries)))

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
                    f"worker {worker} has {threads} threads, but a process does one piece of work at a time; "
                    f"start it with --nthreads 1 and more --nworkers"
                )

    @property
    def workers(self) -> int:
        """Current number of workers, at least one."""
        return max(1, len(self._client.scheduler_info()["workers"]))

    def submit(self, task: Task) -> Any:
        """Start a task on the cluster; two runs that submit a task with the same key share its result."""
        unique, arguments = f"-{uuid.uuid4().hex}" * (not task.key), task.arguments
        if task.shared is not None:
            name = task.shared.name
            if name not in self._shared:
                self._shared[name] = self._client.submit(unpack, task.shared.packed, key=f"shared {name}{unique}")
            arguments = (self._shared[name], *arguments)
        call = (_work_checked, self._version, self.needs, task.work, *arguments)
        future = self._client.submit(*call, key=f"work {task.work.__name__} {task.key}{unique}")
        self._started[future.key] = future
        future.add_done_callback(lambda done: self._started.pop(done.key, None))
        return future

    def forget(self, name: str) -> None:
        """Delete a shared value from the workers."""
        self._shared.pop(name, None)

    def check(self) -> None:
        """Raise an error if the scheduler no longer answers."""
        if self._client.status != "running":
            raise InputError(f"the scheduler {self.address} disappeared; run the same command again to continue")

    def __exit__(self, *error: Any) -> None:
        with contextlib.suppress(OSError):
            self._client.cancel(list(self._started.values()))
        self._client.close()


async def _find_scheduler(address: str) -> None:
    """Check quickly that a scheduler answers at an address."""
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
            f"{where} has a different version of this project or its libraries ({found}; here {wanted}); "
            f"install the same versions in both places and start the worker again"
        )


def _work_checked(wanted: str, needs: Needs, work: Callable[..., Any], *arguments: Any) -> Any:
    """Check the versions of the worker, and run a task on it."""
    from distributed import get_worker

    _check_version(version(needs), wanted, f"worker {get_worker().address}")
    return work(*arguments)


# -- results -----------------------------------------------------------------------------------------


class Batch:
    """Tasks that one caller has started in a pool."""

    def __init__(self, pool: Pool) -> None:
        self._pool, self.flying = pool, 0
        self._finished: queue.SimpleQueue[tuple[Task, Any]] = queue.SimpleQueue()

    @property
    def full(self) -> bool:
        """True if the workers have enough to do."""
        return self.flying >= self._pool.window

    def start(self, task: Task) -> None:
        """Start a task."""
        self.flying += 1
        self._pool.submit(task).add_done_callback(lambda done: self._finished.put((task, done)))

    def landed(self, wait: bool = True) -> Iterator[tuple[Task, Any, Exception | None]]:
        """Yield finished tasks, each with its result or its error; with ``wait``, at least one if any is under way."""
        while self.flying and (wait or not self._finished.empty()):
            try:
                task, future = self._finished.get(timeout=1.0)
            except queue.Empty:
                self._pool.check()
                continue
            self.flying -= 1
            result, error = None, None
            try:
                result = future.result()
            except Exception as failure:
                error = failure
            if isinstance(error, BrokenProcessPool) and task.deaths < MAX_DEATHS:
                task.deaths += 1
                self.start(task)
                continue
            wait = False
            yield task, result, error


def landing(pool: Pool, tasks: Iterable[Task]) -> Iterator[tuple[Task, Any]]:
    """Run tasks, which are taken when they are due, and yield each with its result as soon as it is there.

    Raises InputError if a task refuses its input, or no worker is left.
    """
    batch, coming = Batch(pool), iter(tasks)
    more = True
    while more or batch.flying:
        while more and not batch.full:
            task = next(coming, None)
            if more := task is not None:
                batch.start(task)
        for task, result, error in batch.landed():
            if error is not None:
                words = sentence(error)
                raise error if words is None else InputError(words) from None
            yield task, result


def each(
    pool: Pool,
    work: Callable[..., Any],
    jobs: Iterable[tuple[Any, ...]],
    shared: Shared | None = None,
    store: Store | None = None,
    name: Callable[..., str] = lambda *job: repr(job),
) -> Iterator[Any]:
    """Yield the results of a function for all jobs, in order; raise InputError as ``landing``.

    - ``jobs``: arguments of the calls, taken when a call is due.
    - ``store``: has the results of earlier runs, and receives each new result, which JSON can hold, when it arrives.
    - ``name``: returns the name of a result in the store for the arguments of its call.
    """
    made: dict[int, Any] = {}
    wanted = 0

    def tasks() -> Iterator[Task]:
        for number, job in enumerate(jobs):
            named = name(*job) if store else ""
            if store and named in store:
                made[number] = store[named]
            else:
                yield Task(work, job, shared, digest([store.code, named]) if store else "", (number, named))

    for task, result in itertools.chain(landing(pool, tasks()), [(None, None)]):
        if task is not None:
            number, named = task.name
            made[number] = store.add(named, result) if store else result
        while wanted in made:
            yield made.pop(wanted)
            wanted += 1


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
