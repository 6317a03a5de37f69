"""How a user plays a run again: the command, and the texture by its name."""

from __future__ import annotations

import dataclasses

from model.cli.config_options import option_name
from model.config import ReadoutConfig
from model.errors import InputError
from model.textures.dataset import Dataset, Texture


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


def named(data: Dataset, name: str) -> Texture:
    """Return the texture of a name."""
    for texture in data:
        if texture.name == name:
            return texture
    raise InputError(f"dataset {data.name} has no texture {name!r}; one of them is {data[0].name}")
