"""Convert a texture image to taxel samples with a scan preset (docs/specification.md, section 6).

``PaperScan`` has the constants of the original model, which produced the published event rates. ``PhysicalScan``
follows the description in the paper. All constants are fields. A scan never repeats fields of ``ReadoutConfig`` (array,
sample rate, bits): ``configure`` sets the fields that belong to the preset, and ``signals`` and ``samples`` follow the
configuration. docs/guide/textures.md explains our interpretation of the paper.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, get_args

from eskin.base.errors import InputError
from eskin.skin.textures.paper import PaperScan
from eskin.skin.textures.physical import PhysicalScan
from eskin.skin.textures.scan import Preset, Scan, Signals, quantise

__all__ = ["PRESETS", "PaperScan", "PhysicalScan", "Preset", "Scan", "Signals", "preset", "quantise"]


PRESETS: dict[Preset, Scan] = {"paper": PaperScan(), "physical": PhysicalScan()}
"""The scan of each preset, with the constants of the specification."""


def preset(name: str, wiring: Mapping[str, Any] | None = None) -> Scan:
    """Return the scan preset of a given name.

    ``wiring`` holds ``skin`` and ``taxels`` of the scan (``Scan.wired_to``), as notes on a training store them.
    """
    for known in get_args(Preset):
        if name == known:
            found = PRESETS[known]
            if wiring is None:
                return found
            rows, columns = wiring["skin"]
            return dataclasses.replace(found, skin=(rows, columns), taxels=tuple(wiring["taxels"]))
    raise InputError(f"preset must be one of {', '.join(get_args(Preset))}, not {name!r}")
