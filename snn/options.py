"""What the commands train, crossval and sweep share: their options, and the experiment that these describe."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_type_hints

import typer

from model.cli import build_config
from model.errors import InputError
from snn.recipes import RECIPES

if TYPE_CHECKING:
    from snn.experiment import Experiment

Preset = Annotated[str, typer.Option("--preset", metavar="paper|physical", help="constants of the texture scan")]
Encoding = Annotated[str | None, typer.Option(metavar="lcs|cw-lcs|nlcs", help="encoder [lcs]", show_default=False)]
Resolution = Annotated[int | None, typer.Option(metavar="N", help="LSB = 2**-N of full scale [4]", show_default=False)]
Tau = Annotated[float | None, typer.Option(metavar="SECONDS", help="nlcs: time constant [0.2]", show_default=False)]
ConfigFile = Annotated[
    Path | None, typer.Option("--config", metavar="FILE", help="JSON readout configuration for all other fields")
]
DatasetName = Annotated[
    str | None, typer.Option(metavar="DIR|embedded", help="textures [$ESKIN_DATA, data/kylberg, else embedded]")
]
EventFolder = Annotated[
    Path | None, typer.Option(metavar="DIR", help="event files, as of a replay, instead of textures")
]
Frames = Annotated[int, typer.Option(metavar="K", help="frames instead of events, K side by side in a step [0: no]")]
StartRows = Annotated[int, typer.Option(min=1, help="scans per image (physical)")]
BinSeconds = Annotated[float, typer.Option("--bin", metavar="SECONDS", help="time bin")]
Epochs = Annotated[int, typer.Option(min=1, help="passes over the training scans")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="field of NetworkConfig or TrainConfig, repeatable"),
]
Recipe = Annotated[str, typer.Option(metavar="|".join(RECIPES), help="fields to start from: docs/classifier.md")]
Folds = Annotated[int, typer.Option(help="stratified folds")]
Seeds = Annotated[int, typer.Option(min=1, help="seeds per fold")]
Workers = Annotated[int | None, typer.Option(min=1, help="processes of one thread [one per core]")]

DEFAULT_RESOLUTION = 4


def build_experiment(options: dict[str, Any]) -> Experiment:
    """Return the experiment that the options of a command describe.

    Parameters
    ----------
    options : dict
        Values by name of the parameter: those of the command ``train`` down to ``settings``.

    Raises
    ------
    InputError
        If an option has no meaning, or fits no other.
    """
    from snn.dataset import BinConfig
    from snn.experiment import Experiment
    from snn.scans import FrameConfig
    from snn.train import TrainConfig

    if options["recipe"] not in RECIPES:
        raise InputError(f"recipe must be one of {', '.join(RECIPES)}, not {options['recipe']!r}")
    explicit = {name: options[name] for name in ("encoding", "resolution") if options[name] is not None}
    readout, given = build_config(explicit, None, options["config_file"])
    if "resolution" not in given:
        readout = readout.replace(resolution=DEFAULT_RESOLUTION)
    if options["tau"] is not None and readout.encoding != "nlcs":
        raise InputError(f"--tau is the leak of encoding nlcs, not of {readout.encoding}; add --encoding nlcs")
    fields = RECIPES[options["recipe"]] | parse_settings(options["settings"] or [])
    of_training = {field.name for field in dataclasses.fields(TrainConfig)}
    training = {name: value for name, value in fields.items() if name in of_training}
    return Experiment(
        dataset=options["dataset"],
        events=None if options["events"] is None else str(options["events"]),
        preset=options["preset"],
        readout=readout,
        tau_s=options["tau"],
        frames=FrameConfig(frames_per_step=options["frames"]) if options["frames"] else None,
        start_rows=options["start_rows"],
        bins=BinConfig(bin_s=options["bin_s"]),
        network={name: value for name, value in fields.items() if name not in of_training},
        train=TrainConfig(**(training | {"epochs": options["epochs"]})),
    )


def parse_settings(texts: list[str]) -> dict[str, Any]:
    """Return fields of NetworkConfig and TrainConfig from ``name=value`` texts."""
    from snn.network import NetworkConfig
    from snn.train import TrainConfig

    hints = get_type_hints(TrainConfig) | get_type_hints(NetworkConfig)
    for name in ("inputs", "classes", "epochs"):
        del hints[name]
    found: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or name not in hints:
            raise InputError(f"--set takes NAME=VALUE with a name of {', '.join(sorted(hints))}, not {text!r}")
        hint = hints[name]
        try:
            if hint is bool:
                found[name] = {"true": True, "false": False}[value.lower()]
            else:
                found[name] = value if get_args(hint) else hint(value)
        except (KeyError, ValueError):
            noun = {bool: "true or false", int: "a whole number", float: "a number"}.get(hint, "a word")
            raise InputError(f"--set {name} takes {noun}, not {value!r}") from None
    return found


def check_device(device: str, threads: int) -> None:
    """Set torch up, and refuse a device that is not there."""
    import torch

    torch.set_num_threads(threads)
    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError, NotImplementedError):
        raise InputError(f"device {device} is not available here; use cpu") from None
