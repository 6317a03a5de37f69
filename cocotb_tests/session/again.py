"""How a user plays a run again: the variables behind make."""

from __future__ import annotations

import dataclasses

from model.cli.config_options import option_name
from model.cli.field_options import option_of
from model.config import ReadoutConfig
from model.recordings.options import Preparation


def reproduce(config: ReadoutConfig, simulator: str, seed: int) -> str:
    """Return the command that plays the scenarios of a configuration again and leaves a waveform."""
    return " ".join(["make sim", *variables(config), f"SIM={simulator}", f"SEED={seed}", "TEXTURES=0", "WAVES=1"])


def variables(config: ReadoutConfig) -> list[str]:
    """Return what to write behind make for a configuration: the fields that do not have their default."""
    return [
        f"{option_name(field.name)[2:].replace('-', '_').upper()}={getattr(config, field.name)}"
        for field in dataclasses.fields(config)
        if getattr(config, field.name) != field.default
    ]


def own_variables(options: Preparation, scale: float) -> list[str]:
    """Return what to write behind make for a preparation of own recordings, the scale as it came out."""
    names = {field.name: option_of(field) for field in dataclasses.fields(Preparation)}
    chosen = options.chosen() | {"scale": repr(scale)}
    return [f"{names[name][2:].replace('-', '_').upper()}={value}" for name, value in chosen.items()]
