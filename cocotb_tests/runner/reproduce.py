"""How a user plays a run again: the variables behind make."""

from __future__ import annotations

import dataclasses

from eskin.model.config import ReadoutConfig, option_of
from eskin.model.frame_config import FrameConfig
from eskin.skin.recordings.options import Preparation


def reproduce(config: ReadoutConfig, simulator: str, seed: int) -> str:
    """Return the command that plays the scenarios of a configuration again and leaves a waveform."""
    return " ".join(["make sim", *variables(config), f"SIM={simulator}", f"SEED={seed}", "TEXTURES=0", "WAVES=1"])


def variables(config: ReadoutConfig | FrameConfig) -> list[str]:
    """Return what to write behind make for a configuration: the fields that do not have their default."""
    return [
        f"{option_of(field)[2:].replace('-', '_').upper()}={getattr(config, field.name)}"
        for field in dataclasses.fields(config)
        if field.name != "readout" and getattr(config, field.name) != field.default
    ]


def own_variables(options: Preparation, scale: float) -> list[str]:
    """Return what to write behind make for a preparation of own recordings, the scale as it came out."""
    names = {field.name: option_of(field) for field in dataclasses.fields(Preparation) if field.metadata}
    chosen = options.chosen() | {"scale": repr(scale)}
    return [f"{names[name][2:].replace('-', '_').upper()}={value}" for name, value in chosen.items() if name in names]
