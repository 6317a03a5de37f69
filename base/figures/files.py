"""Write the data and the picture of a figure."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import origin, write_json

DEFAULT_OUT = Path("out")


def write_results(
    out: Path,
    name: str,
    data: dict[str, Any],
    plot: Callable[[dict[str, Any], Path], None],
    data_out: Path | None = None,
    command: str = "",
) -> str:
    """Write the data to ``name``.json and their picture to ``name``.png; return a sentence on the written files.

    Missing folders are made. The typed command is stored in the data, with commit and date.
    """
    data_out = data_out or out
    for folder in (out, data_out):
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot make the folder {folder}: {error.strerror}; choose another --out") from None
    write_json(data_out / f"{name}.json", origin(command) | data)
    plot(data, out / f"{name}.png")
    return f"wrote {data_out / name}.json and {out / name}.png"
