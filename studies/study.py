"""Run a study, ``python -m studies.NAME [--out DIR]``: compute data, write them as JSON, and draw their figure."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import origin, read_json, write_json
from eskin.base.workers.engine import Needs, open_pool, version
from eskin.base.workers.store import Store

ROOT = Path(__file__).parents[1]
DATA = ROOT / "docs" / "data"
"""Folder of the published data."""

OUT = Path("out/studies")
"""Default output folder. Finished parts are always stored in ``OUT/work``."""

Data = dict[str, Any]


@dataclass(frozen=True)
class Result:
    """Data of a study, with their figure."""

    name: str
    """Path of the data, without its ending, in the folder ``data`` of the output folder."""
    compute: Callable[..., Data]
    """Takes the pool if the study has ``needs``, else nothing."""
    draw: Callable[[Data, Path], object] | None = None
    """Draws the figure; its name is the last part of ``name``."""
    long: bool = False
    """The computation takes more than a minute: if the data exist, only the figure is drawn."""
    write: Callable[[Path, Data], None] = write_json
    needs: Needs | None = None
    """Packages and libraries that must be equal on all workers, if the study runs tasks on workers."""
    threads: bool = False
    """Workers on this machine are threads (``open_pool``)."""

    def make(self, study: str, out: Path, workers: int | None = 1, scheduler: str | None = None) -> list[Path]:
        """Write data and figure to a folder; return the paths of the written files."""
        path, written = out / "data" / f"{self.name}.json", []
        if self.long and path.exists():
            print(f"drawing the data in {path}; remove this file to compute them again")
            data: Data = read_json(path, "the data of the study", dict)
        else:
            data = self._computed(workers, scheduler)
            path.parent.mkdir(parents=True, exist_ok=True)
            self.write(path, origin(f"python -m studies.{study}") | data)
            written.append(path)
        if self.draw is not None:
            picture = out / "figures" / f"{Path(self.name).name}.png"
            picture.parent.mkdir(parents=True, exist_ok=True)
            self.draw(data, picture)
            written.append(picture)
        return written

    def _computed(self, workers: int | None, scheduler: str | None) -> Data:
        if self.needs is None:
            return self.compute()
        with open_pool(workers, scheduler, self.needs, threads=self.threads) as pool:
            return self.compute(pool)


def work_of(study: str, needs: Needs) -> Store:
    """Return the store of the finished parts of a study; parts of other code are computed again."""
    folder = OUT / "work"
    folder.mkdir(parents=True, exist_ok=True)
    return Store(folder / f"{study}.json", version(needs))


def run(study: str, *results: Result) -> None:
    """Run a study with the options of the command line, and exit."""
    main = sys.modules["__main__"]
    parser = argparse.ArgumentParser(f"python -m studies.{study}", description=main.__doc__)
    text = f"folder for data and figures [{OUT}]; with --out docs, the study draws its figure of the documents"
    parser.add_argument("--out", type=Path, default=OUT, metavar="DIR", help=text)
    if any(result.needs for result in results):
        text = "parallel processes on this machine [one per usable core]"
        parser.add_argument("--workers", type=int, metavar="N", help=text)
        text = "Dask scheduler, tcp://HOST:8786, instead of this machine"
        parser.add_argument("--scheduler", metavar="ADDRESS", help=text)
    options = vars(parser.parse_args())
    try:
        for result in results:
            for path in result.make(study, **options):
                print(f"wrote {path}")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("stopped; run the study again to continue", file=sys.stderr)
        sys.exit(130)
