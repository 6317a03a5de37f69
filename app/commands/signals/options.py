"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

OutOption = Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="folder for data and picture")]
DataOutOption = Annotated[
    Path | None, typer.Option("--data-out", metavar="DIR", help="folder for the data, if another", show_default=False)
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
