"""Options shared by several commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from eskin.app.options import LEAKY, opt, out_folder
from eskin.skin.textures.rates import PAPER_TAU_S

OutOption = Annotated[Path, out_folder("DIR", "folder for data and picture")]
DataOutOption = Annotated[
    Path | None, out_folder("--data-out", "DIR", "folder for the data [folder of the picture]", show_default=False)
]
SettingsOption = Annotated[list[str] | None, opt("--set", "NAME=NUMBER", "change a parameter, repeatable")]
SynthesisOption = Annotated[
    list[Path] | None, opt("FILE", "synthesis report (JSON) of a readout's digital part, repeatable")
]
DatasetOption = Annotated[str | None, opt("DIR|embedded", "measure event rates on these textures [stored rates]")]
TexturesOption = Annotated[str | None, opt("DIR|embedded", "textures [$ESKIN_DATA, data/kylberg, else embedded]")]
ScanOption = Annotated[str, opt("--preset", "paper|physical", "constants of the texture scan")]
LimitOption = Annotated[int | None, opt("K", "number of images, evenly spread [all]")]
TauOption = Annotated[float | None, opt("SECONDS", f"{', '.join(LEAKY)}: time constant [{PAPER_TAU_S}]")]
PresetOption = Annotated[str, opt("--preset", "paper|physical", "texture scan of the event rates")]
RatesOption = Annotated[Path | None, opt("--rates", "FILE", "event rates, from eskin event-rates")]
JsonOption = Annotated[bool, opt("--json", "print one JSON object")]
