"""Run tasks on the workers of a Dask cluster."""

import asyncio
import contextlib
import functools
import hashlib
import importlib
import importlib.metadata
import logging
import uuid
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.workers.pool import SPARE, Shared, WorkerPool, unpack

CONNECT_S, WORKERS_S = 5.0, 10.0
"""Time limits in seconds for the answer of a scheduler, and for its first worker."""


@dataclass(frozen=True)
class Needs:
    """Packages and libraries that need equal versions in a worker and in this process."""

    packages: tuple[str, ...] = ("base", "model", "skin", "power")
    libraries: tuple[str, ...] = ("numpy", "scipy", "numba")


@functools.cache
def version(needs: Needs) -> str:
    """Return a text that identifies the versions of this project's sources and of numerical libraries."""
    found = hashlib.sha256()
    for package in needs.packages:
        folder = Path(str(importlib.import_module(f"eskin.{package}").__file__)).parent
        for path in sorted(path for kind in ("*.py", "*.cpp", "*.v") for path in folder.rglob(kind)):
            found.update(f"{path.relative_to(folder.parent)}\0".encode() + path.read_bytes() + b"\0")
    versions = [f"{name} {importlib.metadata.version(name)}" for name in needs.libraries]
    return ", ".join([found.hexdigest()[:16], *versions])


class Cluster(WorkerPool):
    """The workers of a Dask scheduler, each with one thread.

    A shared value is the result of its own task, so that Dask can make it again after a worker died. The address is
    tcp://HOST:PORT. Raises InputError if the scheduler does not answer, has no worker, or a worker has other versions.
    """

    def __init__(self, address: str, needs: Needs) -> None:
        import distributed

        self.address, self.needs = address, needs
        self._version = version(needs)
        self._shared: dict[str, Any] = {}
        self._pieces: dict[Any, Any] = {}
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

            module = importlib.import_module("eskin.base.workers.cluster")
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

    @property
    def window(self) -> int:
        """Number of tasks to keep submitted: the workers plus a short queue."""
        return len(self._client.scheduler_info()["workers"]) + SPARE

    def submit(self, work: Callable[..., Any], *arguments: Any, shared: Shared | None = None) -> Any:
        """Submit a task to the cluster and return its future."""
        unique = uuid.uuid4().hex
        if shared is not None:
            if shared.name not in self._shared:
                key = f"shared {shared.name}-{unique}"
                self._shared[shared.name] = self._client.submit(unpack, shared.packed, key=key)
            arguments = (self._shared[shared.name], *arguments)
        key = f"work {work.__name__}-{unique}"
        future = self._client.submit(_work_checked, self._version, self.needs, work, *arguments, key=key)
        self._pieces[future.key] = future
        future.add_done_callback(lambda done: self._pieces.pop(done.key, None))
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
            self._client.cancel(list(self._pieces.values()))
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
