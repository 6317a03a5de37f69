"""Run a study, ``python -m studies.NAME [--out DIR]``: compute data, write them as JSON, and draw their figure."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import Pieces, origin, read_json, write_json

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
    compute: Callable[[], Data]
    draw: Callable[[Data, Path], object] | None = None
    """Draws the figure; its name is the last part of ``name``."""
    long: bool = False
    """The computation takes more than a minute: if the data exist, only the figure is drawn."""
    write: Callable[[Path, Data], None] = write_json

    def make(self, study: str, out: Path) -> list[Path]:
        """Write data and figure to a folder; return the paths of the written files."""
        path, written = out / "data" / f"{self.name}.json", []
        if self.long and path.exists():
            print(f"drawing the data in {path}; remove this file to compute them again")
            data: Data = read_json(path, "the data of the study", dict)
        else:
            data = self.compute()
            path.parent.mkdir(parents=True, exist_ok=True)
            self.write(path, origin(f"python -m studies.{study}") | data)
            written.append(path)
        if self.draw is not None:
            picture = out / "figures" / f"{Path(self.name).name}.png"
            picture.parent.mkdir(parents=True, exist_ok=True)
            self.draw(data, picture)
            written.append(picture)
        return written


def work_of(study: str, code: str = "") -> Pieces:
    """Return the store of the finished parts of a study, which a stopped run reads when it continues.

    ``code``: digest of the code; parts of other code are computed again.
    """
    folder = OUT / "work"
    folder.mkdir(parents=True, exist_ok=True)
    return Pieces(folder / f"{study}.json", code)


def run(study: str, *results: Result) -> None:
    """Run a study with the options of the command line, and exit."""
    main = sys.modules["__main__"]
    parser = argparse.ArgumentParser(f"python -m studies.{study}", description=main.__doc__)
    text = f"folder for data and figures [{OUT}]; with --out docs, the study draws its figure of the documents"
    parser.add_argument("--out", type=Path, default=OUT, metavar="DIR", help=text)
    out = parser.parse_args().out
    try:
        for result in results:
            for path in result.make(study, out):
                print(f"wrote {path}")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("stopped; run the study again to continue", file=sys.stderr)
        sys.exit(130)
