"""Options for parallel work on this machine or on a Dask cluster."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from eskin.app.options import opt
from eskin.base.errors import InputError

if TYPE_CHECKING:
    from eskin.base.workers.cluster import Needs
    from eskin.base.workers.pool import WorkerPool

Workers = Annotated[int | None, opt("N", "parallel processes on this machine [one per usable core]")]
Scheduler = Annotated[str | None, opt("ADDRESS", "Dask scheduler, tcp://HOST:8786, instead of this machine")]


def open_pool(
    workers: int | None, scheduler: str | None, needs: Needs | None = None, *, threads: bool = False
) -> WorkerPool:
    """Return the worker pool for the user's options.

    Workers of a Dask scheduler must share the versions of ``needs``, by default those of the model. On this machine,
    threads instead of processes are for work that releases the interpreter lock.
    """
    if scheduler is None:
        from eskin.base.workers.pool import Local

        return Local(workers, threads)
    if workers is not None:
        raise InputError("--workers starts processes on this machine, --scheduler uses a cluster; give one")
    from eskin.base.workers.cluster import Cluster, Needs

    return Cluster(scheduler, needs or Needs())
