"""What the commands train, crossval and sweep share: their options, and the experiment that these describe."""

from __future__ import annotations

import dataclasses
import inspect
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from model.cli.config_options import CONFIG_FILE, build_config
from model.cli.field_options import field_options, parse_fields, replace_parameters
from model.commands.recordings import PREPARATION, OwnData, events_of, option_named
from model.config import ReadoutConfig
from model.errors import InputError
from model.files import check_writable
from model.recordings.options import Preparation
from snn.data.frame_steps import FRAMES, FrameSteps
from snn.experiments.recipes import RECIPES

if TYPE_CHECKING:
    from snn.experiments.experiment import Experiment

Preset = Annotated[str | None, typer.Option(metavar="paper|physical", help="constants of the texture scan [physical]")]
Tau = Annotated[float | None, typer.Option(metavar="SECONDS", help="nlcs: time constant [0.2]", show_default=False)]
DatasetName = Annotated[
    str | None, typer.Option(metavar="DIR|embedded", help="textures [$ESKIN_DATA, data/kylberg, else embedded]")
]
EventFolder = Annotated[
    Path | None, typer.Option(metavar="DIR", help="event files, as of a replay, instead of textures")
]
Frames = Annotated[
    str | None, typer.Option(metavar=FRAMES, help="frames instead of events, as frame-diff:250:8; RATE in hertz")
]
StartRows = Annotated[int | None, typer.Option(min=1, help="scans per image (physical) [1]")]
Disturbed = Annotated[
    int | None, typer.Option(min=1, help="further scans per image, each disturbed at random, to learn (physical)")
]
BinSeconds = Annotated[
    float | None, typer.Option("--bin", metavar="SECONDS", help="time bin, or step of frames [0.004]")
]
Start = Annotated[
    float | None,
    typer.Option(metavar="SECONDS", help="events count from there [0; paper 0.01, nlcs 0.1]", show_default=False),
]
Epochs = Annotated[int, typer.Option(min=1, help="passes over the training scans")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="field of NetworkConfig or TrainConfig, repeatable"),
]
Grid = Annotated[
    list[str] | None,
    typer.Option("--grid", metavar="NAME=VALUE,...", help="values to try, chosen by inner validation; repeatable"),
]
Recipe = Annotated[str, typer.Option(metavar="|".join(RECIPES), help="fields to start from: docs/guide/classifier.md")]
Folds = Annotated[int, typer.Option(min=2, help="stratified folds")]
Seeds = Annotated[int, typer.Option(min=1, help="seeds per fold")]
Workers = Annotated[int | None, typer.Option(min=1, help="processes of one thread [one per usable core]")]

DEFAULT_RESOLUTION = 4

WITHOUT_EFFECT = {
    "frames": ("encoding", "resolution", "tau", "start"),
    "events": ("preset", "encoding", "resolution", "tau", "config_file", "dataset", "start_rows", "disturbed", "data"),
    "data": ("preset", "tau", "dataset", "start_rows", "disturbed", "frames"),
}
"""Parameters that mean nothing beside another: frames have no encoder, and recordings were scanned before."""

_NAMES = {"bin_s": "bin", "config_file": "config", "start_rows": "start-rows"}


ENCODER = ("encoding", "resolution")
"""Fields of the readout that have an option of their own; ``--config`` has all."""

OWN = field_options(Preparation, PREPARATION, {"baseline": "first"})

READOUT = [*field_options(ReadoutConfig, ENCODER, {"resolution": DEFAULT_RESOLUTION}), CONFIG_FILE]


def _options(
    preset: Preset = None,
    tau: Tau = None,
    dataset: DatasetName = None,
    events: EventFolder = None,
    data: OwnData = None,
    frames: Frames = None,
    start_rows: StartRows = None,
    disturbed: Disturbed = None,
    bin_s: BinSeconds = None,
    start: Start = None,
    recipe: Recipe = "tuned",
    epochs: Epochs = 60,
    settings: Settings = None,
    grid: Grid = None,
) -> None:
    """Have the options that describe an experiment beside those of the readout, in their order; never called."""


NOT_OF_A_SWEEP = ("encoding", "resolution", "events", "frames")
"""Options of an experiment that the points of a sweep say instead."""


def with_experiment(command: Callable[..., Any]) -> Callable[..., Any]:
    """Replace the parameter ``made`` of a command, an Experiment (whose module loads torch), by the options for it.

    A parameter ``options`` instead receives their values by name, without those that the points of a sweep say.
    """
    others = inspect.signature(_options, eval_str=True).parameters.values()
    options = [*READOUT, *(p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in others), *OWN]
    if "made" in inspect.signature(command).parameters:
        return replace_parameters(command, ["made"], options, _made)
    kept = [option for option in options if option.name not in NOT_OF_A_SWEEP]
    return replace_parameters(command, ["options"], kept, lambda values: {"options": values})


def _made(values: dict[str, Any]) -> dict[str, Any]:
    """Return the experiment of a command for one network; a setting that this network does not have is refused."""
    made = build_experiment(values)
    kind, idle = idle_settings(made, values["settings"])
    if idle:
        raise InputError(f"{idle[0]} means nothing to a network of kind {kind}; leave it out")
    return {"made": made}


def idle_settings(made: Experiment, settings: list[str] | None) -> tuple[str, list[str]]:
    """Return the kind of network of an experiment, and what of ``--set`` and ``--grid`` means nothing to it."""
    from snn.flat import hints_of
    from snn.network_config import NetworkConfig
    from snn.training import TrainConfig

    config = NetworkConfig.from_dict({"inputs": 1, "classes": 1} | made.network)
    known = {*hints_of(NetworkConfig), *hints_of(type(config.units)), *hints_of(TrainConfig), "kind"}
    given = [("--set", name) for name in parse_settings(settings or [])]
    given += [("--grid", name) for name in made.grid or {}]
    return config.kind, [f"{option} {name}" for option, name in given if name not in known]


def build_experiment(options: dict[str, Any]) -> Experiment:
    """Return the experiment that the options of a command describe.

    Parameters
    ----------
    options : dict
        Values by name, of all parameters of ``_options``, and texts of the fields of Preparation.

    Raises
    ------
    InputError
        If an option has no meaning, or fits no other.
    """
    from snn.data.bins import BinConfig
    from snn.experiments.experiment import Experiment
    from snn.flat import hints_of
    from snn.training import TrainConfig

    if options["recipe"] not in RECIPES:
        raise InputError(f"recipe must be one of {', '.join(RECIPES)}, not {options['recipe']!r}")
    for other, names in WITHOUT_EFFECT.items():
        if idle := [_NAMES.get(name, name) for name in names if options[other] and options[name] is not None]:
            raise InputError(f"--{idle[0]} has no effect with --{other}; leave one of the two out")
    texts = {name: options[name] for name in ENCODER}
    readout, given = build_config(parse_fields(ReadoutConfig, texts), None, options["config_file"])
    if "resolution" not in given:
        readout = readout.replace(resolution=DEFAULT_RESOLUTION)
    tau_s = options["tau"]
    if tau_s is not None and readout.encoding != "nlcs":
        raise InputError(f"--tau is the leak of encoding nlcs, not of {readout.encoding}; add --encoding nlcs")
    prepared = parse_fields(Preparation, {name: options[name] for name in PREPARATION})
    if options["data"] is not None:
        folder = events_of(options["data"], prepared, readout, given | {"resolution"})
        options = options | {"events": folder, "bin_s": options["bin_s"] or _bin_of(folder)}
    elif prepared:
        raise InputError(f"{option_named(next(iter(prepared)))} is for your own recordings; add --data DIR")
    bins = BinConfig(start_s=options["start"])
    bins = bins if options["bin_s"] is None else dataclasses.replace(bins, bin_s=options["bin_s"])
    frames = None if options["frames"] is None else FrameSteps.parse(options["frames"], bins.bin_s)
    fields = RECIPES[options["recipe"]]
    if frames is not None and frames.step_s > bins.bin_s:
        fields = fields | {"shift_steps": round(fields.get("shift_steps", 0) * bins.bin_s / frames.step_s)}
    fields = fields | parse_settings(options["settings"] or [])
    of_training = hints_of(TrainConfig)
    training = {name: value for name, value in fields.items() if name in of_training}
    return Experiment(
        dataset=options["dataset"],
        events=None if options["events"] is None else str(options["events"]),
        readout=readout,
        tau_s=tau_s,
        given_leak=readout.encoding == "nlcs" and bool(given & {"leak_shift", "leak_period"}),
        frames=frames,
        bins=bins if frames is None else BinConfig(),
        network={name: value for name, value in fields.items() if name not in of_training},
        train=TrainConfig.from_dict(training | {"epochs": options["epochs"]}),
        grid=parse_grid(options["grid"]) if options.get("grid") else None,
        **{
            name: options[name]
            for name in ("preset", "start_rows", "disturbed", "variant")
            if options.get(name) is not None
        },
    )


def _bin_of(folder: Path) -> float | None:
    """Return a sample period of own recordings where it is longer than the default bin: shorter ones would be empty."""
    from model.events.recording import Recording
    from snn.data.bins import BinConfig
    from snn.data.recordings import event_files

    period_s = 1 / Recording.load(event_files([folder])[0].path).config.sample_rate_hz
    if period_s <= BinConfig().bin_s:
        return None
    print(f"time bin: {period_s:.4g} s, one sample of these recordings; --bin chooses another")
    return period_s


def parse_settings(texts: list[str], option: str = "--set") -> dict[str, Any]:
    """Return fields of NetworkConfig and TrainConfig from the ``name=value`` texts of an option."""
    from snn.flat import hints_of
    from snn.network_config import HINTS
    from snn.training import TrainConfig

    hints = hints_of(TrainConfig) | HINTS
    for name in ("inputs", "classes", "epochs"):
        del hints[name]
    found: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or name not in hints:
            raise InputError(f"{option} takes NAME=VALUE with a name of {', '.join(sorted(hints))}, not {text!r}")
        hint = hints[name]
        try:
            if hint is bool:
                found[name] = {"true": True, "false": False}[value.lower()]
            else:
                found[name] = value if get_args(hint) else hint(value)
        except (KeyError, ValueError):
            noun = {bool: "true or false", int: "a whole number", float: "a number"}.get(hint, "a word")
            raise InputError(f"{option} {name} takes {noun}, not {value!r}") from None
    return found


def parse_grid(texts: list[str]) -> dict[str, list[Any]]:
    """Return the values to try from ``name=value,value`` texts."""
    found: dict[str, list[Any]] = {}
    for text in texts:
        name, _, values = text.partition("=")
        if name in found:
            raise InputError(f"--grid has {name} twice; give its values with commas between")
        found[name] = [parse_settings([f"{name}={value}"], "--grid")[name] for value in values.split(",")]
    return found


def check_device(device: str, threads: int) -> None:
    """Set torch up, and refuse a device that is not there."""
    import torch

    torch.set_num_threads(threads)
    try:
        float(torch.zeros(1, device=device))
    except (RuntimeError, AssertionError, NotImplementedError):
        raise InputError(f"device {device!r} is not available here; use cpu") from None


def output_folder(folder: Path, *names: str) -> None:
    """Make a folder, and refuse one in which these files cannot be written, before any work is done."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        check_writable(folder / name)
    if not os.access(folder, os.W_OK):
        raise InputError(f"cannot write into {folder}; choose another folder with --out")
