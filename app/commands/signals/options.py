"""Options shared by several commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from eskin.app.options import WRITES_FOLDER

OutOption = Annotated[
    Path, typer.Option("-o", "--out", metavar="DIR", help="folder for data and picture"), WRITES_FOLDER
]
DataOutOption = Annotated[
    Path | None,
    typer.Option("--data-out", metavar="DIR", help="folder for the data [folder of the picture]", show_default=False),
    WRITES_FOLDER,
]
SettingsOption = Annotated[
    list[str] | None, typer.Option("--set", metavar="NAME=NUMBER", help="change a parameter, repeatable")
]
SynthesisOption = Annotated[
    list[Path] | None,
    typer.Option(metavar="FILE", help="synthesis report (JSON) of a readout's digital part, repeatable"),
]
DatasetOption = Annotated[
    str | None, typer.Option(metavar="DIR|embedded", help="measure event rates on these textures [stored rates]")
]
PresetOption = Annotated[
    str, typer.Option("--preset", metavar="paper|physical", help="texture scan of the event rates")
]
RatesOption = Annotated[
    Path | None, typer.Option("--rates", metavar="FILE", help="event rates, from eskin event-rates")
]
JsonOption = Annotated[bool, typer.Option("--json", help="print one JSON object")]
