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

    Parameters
    ----------
    workers : int or None
    scheduler : str or None
        Address of a Dask scheduler.
    needs : Needs, optional
        Versions that its workers must share; those of the model by default.
    threads : bool
        On this machine: threads and not processes, for work that lets go of the interpreter.
    """
    if scheduler is None:
        from eskin.base.workers.pool import Local

        return Local(workers, threads)
    if workers is not None:
        raise InputError("--workers starts processes on this machine, --scheduler uses a cluster; give one")
    from eskin.base.workers.cluster import Cluster, Needs

    return Cluster(scheduler, needs or Needs())
