"""Commands that repeat a run."""

import dataclasses
import json
import shlex
from collections.abc import Collection
from typing import Any

from eskin.base.configuration import option_of
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.skin.recordings.options import Preparation, Scale, scale_option


def reproduce(config: ReadoutConfig, simulator: str, seed: int, command: str = "sim") -> str:
    """Return the command that repeats the scenarios of a configuration with a waveform."""
    words = [f"eskin {command}", *options(config), f"--sim {simulator}", f"--seed {seed}", "--textures 0", "--waves"]
    return " ".join(words)


def options(config: ReadoutConfig) -> list[str]:
    """Return command-line options for the non-default fields of a configuration."""
    return [f"{option} {text}" for option, text in _changed(config)]


def variables(config: ReadoutConfig | FrameConfig, without: Collection[str] = ()) -> list[str]:
    """Return make variables for the non-default fields of a configuration."""
    return [f"{option[2:].replace('-', '_').upper()}={text}" for option, text in _changed(config, without)]


def _changed(config: ReadoutConfig | FrameConfig, without: Collection[str] = ()) -> list[tuple[str, str]]:
    """Return option and value of the non-default fields of a configuration."""
    idle = {"readout", *without, *(config.idle_fields if isinstance(config, ReadoutConfig) else ())}
    return [
        (option_of(field), _text(getattr(config, field.name)))
        for field in dataclasses.fields(config)
        if field.name not in idle and getattr(config, field.name) != field.default
    ]


def _text(value: Any) -> str:
    """Return a value as text for make and the shell."""
    if not isinstance(value, tuple):
        return str(value)
    return shlex.quote(json.dumps([one.to_dict() for one in value], separators=(",", ":")))


def own_options(prepared: Preparation, scale: Scale) -> list[str]:
    """Return command-line options for the preparation of recordings."""
    names = {field.name: option_of(field) for field in dataclasses.fields(Preparation) if field.metadata}
    chosen = prepared.chosen() | {"scale": scale_option(scale)}
    return [f"{names[name]}={shlex.quote(str(value))}" for name, value in chosen.items() if name in names]
