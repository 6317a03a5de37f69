"""Options shared by several commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from eskin.app.options import LEAKY, WRITES_FOLDER
from eskin.skin.textures.rates import PAPER_TAU_S

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
TexturesOption = Annotated[
    str | None, typer.Option(metavar="DIR|embedded", help="textures [$ESKIN_DATA, data/kylberg, else embedded]")
]
ScanOption = Annotated[str, typer.Option("--preset", metavar="paper|physical", help="constants of the texture scan")]
LimitOption = Annotated[int | None, typer.Option(metavar="K", help="number of images, evenly spread [all]")]
TauOption = Annotated[
    float | None, typer.Option(metavar="SECONDS", help=f"{', '.join(LEAKY)}: time constant [{PAPER_TAU_S}]")
]
PresetOption = Annotated[
    str, typer.Option("--preset", metavar="paper|physical", help="texture scan of the event rates")
]
RatesOption = Annotated[
    Path | None, typer.Option("--rates", metavar="FILE", help="event rates, from eskin event-rates")
]
JsonOption = Annotated[bool, typer.Option("--json", help="print one JSON object")]
