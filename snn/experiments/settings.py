"""Parse experiment settings and sweep points from command-line texts."""

from collections.abc import Mapping
from typing import Any, get_args, get_type_hints

from eskin.base.errors import InputError
from eskin.model.encoders import registry
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.frame_steps import FRAMES, FrameKind, FrameSteps
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.recipes import BASELINES, RECIPES
from eskin.snn.network_config import NetworkConfig, fields_of
from eskin.snn.training import TrainConfig, parted

NOUNS = {bool: "true or false", int: "a whole number", float: "a number", str: "a word"}

VARIANTS = {encoder.name: ("", "on") if encoder.polarity else ("",) for encoder in registry.ENCODERS}
"""Variants of an encoder's events (``eskin.snn.data.record``), written after the resolution: lcs:6:on."""


def parse_settings(texts: list[str], option: str = "--set") -> dict[str, Any]:
    """Return the network and training parameters for ``name=value`` texts."""
    hints = get_type_hints(TrainConfig) | get_type_hints(NetworkConfig)
    for name in ("inputs", "classes", "epochs", "layers"):
        del hints[name]
    found: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or name not in hints:
            raise InputError(
                f"{option} needs NAME=VALUE with one of the names {', '.join(sorted(hints))}, not {text!r}"
            )
        hint = str if get_args(hints[name]) else hints[name]
        try:
            found[name] = {"true": True, "false": False}[value.lower()] if hint is bool else hint(value)
        except (KeyError, ValueError):
            raise InputError(f"{option} {name} takes {NOUNS[hint]}, not {value!r}") from None
    return found


def parse_grid(texts: list[str]) -> dict[str, list[Any]]:
    """Return the parameter grid for ``name=value,value`` texts."""
    found: dict[str, list[Any]] = {}
    for text in texts:
        name, _, values = text.partition("=")
        if name in found:
            raise InputError(f"--grid has {name} twice; separate its values by commas")
        found[name] = [parse_settings([f"{name}={value}"], "--grid")[name] for value in values.split(",")]
    return found


def idle_settings(made: Experiment, settings: list[str] | None) -> tuple[str, list[str]]:
    """Return the kind of network, and the given settings that have no effect on this kind."""
    config = NetworkConfig.from_dict({"inputs": 1, "classes": 1} | made.network)
    known = {*fields_of(config.kind), *get_type_hints(TrainConfig)}
    given = [("--set", name) for name in parse_settings(settings or [])]
    given += [("--grid", name) for name in made.grid or {}]
    return config.kind, [f"{option} {name}" for option, name in given if name not in known]


def parse_points(text: str) -> list[tuple[str, str]]:
    """Return a pair (readout, numbers) for each sweep point in a text such as ``lcs:4,rnn:20``.

    The numbers are the resolution of an encoder, rate and bits of frames, or frames per step of a baseline.

    Raise InputError if the text is not a list of points separated by commas, or contains a point twice.
    """
    readouts = (*registry.NAMES, *BASELINES, *get_args(FrameKind))
    found = []
    for part in text.split(","):
        readout, _, numbers = part.strip().partition(":")
        bits, _, variant = numbers.partition(":")
        whole = bits.isascii() and bits.isdigit() and variant in VARIANTS.get(readout, ("",))
        if readout not in readouts or not (whole or readout in get_args(FrameKind)):
            raise InputError(
                f"a point must be ENCODER:RESOLUTION (encoders: {', '.join(registry.NAMES)}), {FRAMES} (hertz, bits) "
                f"or BASELINE:FRAMES_PER_STEP (baselines: {', '.join(BASELINES)}), not {part.strip()!r}; separate "
                f"points by commas"
            )
        point = (readout, f"{int(bits)}{f':{variant}' if variant else ''}" if whole else numbers)
        if point in found:
            raise InputError(f"--points has {':'.join(point)} twice; leave one out")
        found.append(point)
    return found


def experiment_of(
    recipe: str, settings: Mapping[str, Any], epochs: int, bins: BinConfig, frames: str | None = None, **fields: Any
) -> Experiment:
    """Return the experiment for a recipe.

    Raise InputError if a name is unknown, or a field does not fit another.

    - ``recipe``: a name of ``eskin.snn.experiments.recipes.RECIPES``.
    - ``settings``: fields of NetworkConfig and TrainConfig that replace those of the recipe.
    - ``bins``: time bins of events; their length is the step of frames.
    - ``frames``: frames instead of events, in the form of ``FrameSteps.parse``.
    - ``**fields``: other fields of Experiment; None means the default.
    """
    if recipe not in RECIPES:
        raise InputError(f"recipe must be one of {', '.join(RECIPES)}, not {recipe!r}")
    steps = None if frames is None else FrameSteps.parse(frames, bins.bin_s)
    values = RECIPES[recipe]
    if steps is not None and steps.step_s > bins.bin_s:
        values = values | {"shift_steps": round(values.get("shift_steps", 0) * bins.bin_s / steps.step_s)}
    network, training = parted(values | dict(settings))
    return Experiment(
        frames=steps,
        bins=bins if steps is None else BinConfig(),
        network=network,
        train=TrainConfig.from_dict(training | {"epochs": epochs}),
        **{name: value for name, value in fields.items() if value is not None},
    )
