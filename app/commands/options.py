"""Options that several commands share, and the worker pool that some of them choose."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from eskin.app.options import LEAKY, opt, out_folder
from eskin.base.errors import InputError
from eskin.base.workers.cluster import Cluster, Needs
from eskin.base.workers.pool import Local, WorkerPool
from eskin.skin.textures.rates import PAPER_TAU_S

Out = Annotated[Path, out_folder(..., "DIR", "folder for data and picture")]
DataOut = Annotated[
    Path | None, out_folder(..., "--data-out", "DIR", "folder for the data [folder of the picture]", show_default=False)
]
Settings = Annotated[list[str] | None, opt(..., "--set", "NAME=NUMBER", "change a parameter, repeatable")]
Synthesis = Annotated[
    list[Path] | None, opt(..., "FILE", "synthesis report (JSON) of a readout's digital part, repeatable")
]
Dataset = Annotated[str | None, opt(..., "DIR|embedded", "measure event rates on these textures [stored rates]")]
Textures = Annotated[str | None, opt(..., "DIR|embedded", "textures [$ESKIN_DATA, data/kylberg, else embedded]")]
Scan = Annotated[str, opt(..., "--preset", "paper|physical", "constants of the texture scan")]
Limit = Annotated[int | None, opt(..., "K", "number of images, evenly spread [all]")]
Tau = Annotated[float | None, opt(..., "SECONDS", f"{', '.join(LEAKY)}: time constant [{PAPER_TAU_S}]")]
Preset = Annotated[str, opt(..., "--preset", "paper|physical", "texture scan of the event rates")]
Rates = Annotated[Path | None, opt(..., "--rates", "FILE", "event rates, from eskin event-rates")]
Json = Annotated[bool, opt(..., "--json", "print one JSON object")]
Workers = Annotated[int | None, opt(..., "N", "parallel processes on this machine [one per usable core]")]
Scheduler = Annotated[str | None, opt(..., "ADDRESS", "Dask scheduler, tcp://HOST:8786, instead of this machine")]


def open_pool(
    workers: int | None, scheduler: str | None, needs: Needs | None = None, *, threads: bool = False
) -> WorkerPool:
    """Return the worker pool for the user's options.

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
