"""The workers of a Dask cluster, in the place of processes of this machine."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import hashlib
import logging
import uuid
import warnings
from pathlib import Path
from types import TracebackType
from typing import Any

import model
import snn
from model.errors import InputError
from snn.data.scans import ScanData
from snn.experiments.experiment import Experiment
from snn.experiments.workers import SPARE, unpack, work

CONNECT_S, WORKERS_S = 5.0, 10.0
"""Seconds that a scheduler may take to answer, and its first worker to appear."""


def version() -> str:
    """Return a text that differs where this project or the libraries that compute do."""
    import numpy
    import torch

    found = hashlib.sha256()
    for package in (snn, model):
        folder = Path(str(package.__file__)).parent
        for path in sorted([*folder.rglob("*.py"), *folder.rglob("*.cpp")]):
            found.update(f"{path.relative_to(folder.parent)}\0".encode() + path.read_bytes() + b"\0")
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

            return str(importlib.import_module("snn.experiments.cluster").version())

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
