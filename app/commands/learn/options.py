"""Common options of train, crossval and sweep, and the experiment that they define."""

from __future__ import annotations

import dataclasses
import inspect
import itertools
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from eskin.app.commands import common
from eskin.app.commands.signals.recordings import PREPARATION, OwnData, check_alone, events_of
from eskin.app.options import (
    CONFIG_FILE,
    LEAKY,
    RECORDINGS,
    build_config,
    check_leaks,
    field_options,
    opt,
    parse_fields,
    replace_parameters,
)
from eskin.base.errors import InputError
from eskin.base.outputs import check_file
from eskin.model.config import ReadoutConfig
from eskin.skin.recordings.options import Preparation
from eskin.skin.textures.choice import CHOICES, choose
from eskin.snn.data.frame_steps import FRAMES, FrameSteps
from eskin.snn.experiments.recipes import RECIPES

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from eskin.skin.recordings.fitting import Fit
    from eskin.snn.data.scans import ScanData
    from eskin.snn.experiments.experiment import Experiment
    from eskin.snn.training import TrainConfig

Preset = Annotated[str | None, opt(..., "paper|physical", "constants of the texture scan [physical]")]
Tau = Annotated[float | None, opt(..., "SECONDS", f"{', '.join(LEAKY)}: time constant [0.2]", show_default=False)]
BinSeconds = Annotated[float | None, opt(..., "--bin", "SECONDS", "time bin, or step of frames [0.004]")]
Folds = Annotated[int, opt(..., "stratified folds", min=2)]
Seeds = Annotated[int, opt(..., "seeds per fold", min=1)]
Workers = Annotated[int | None, opt(..., "number of worker processes [one per usable core]", min=1)]

DEFAULT_RESOLUTION, EPOCHS = 4, 60

WITHOUT_EFFECT = {
    "frames": "encoding resolution tau start receptive_fields gains",
    "events": "preset encoding resolution tau receptive_fields config_file dataset start_rows disturbed taxels data "
    "gains",
    "data": "preset dataset start_rows disturbed taxels",
}
"""Parameters without effect beside another parameter: frames have no encoder, and recordings are no scans."""

_NAMES = {"bin_s": "bin", "config_file": "config", "start_rows": "start-rows"}


ENCODER = ("encoding", "resolution", "receptive_fields", "sample_rate_hz")
"""Fields of the readout with an option; ``--config`` sets all fields."""

OWN = field_options(
    Preparation, PREPARATION, {"baseline": "first; train: chosen by inner validation", "strict": True}, RECORDINGS
)

_IN_HELP = {
    "encoding": "lcs; train --data: chosen by inner validation",
    "resolution": f"{DEFAULT_RESOLUTION}; --data: follows the recordings",
    "sample_rate_hz": "time stamps",
}

READOUT = [*field_options(ReadoutConfig, ENCODER, _IN_HELP), CONFIG_FILE]


def _options(
    data: OwnData = None,
    dataset: common.Textures = None,
    events: Path | None = opt(None, "DIR", "event files, for example of a replay, instead of textures"),
    preset: Preset = None,
    recipe: str | None = opt(None, "|".join(RECIPES), "named settings: docs/guide/classifier.md [tuned; --data: skin]"),
    epochs: int | None = opt(None, "passes over the training scans [60; train --data: 2400 updates]", min=1),
    bin_s: BinSeconds = None,
    frames: str | None = opt(None, FRAMES, "frames instead of events, such as frame-diff:250:8 (250 Hz, 8 bits)"),
    taxels: str | None = opt(None, CHOICES, "taxels of the array to use [all]"),
    tau: Tau = None,
    start: float | None = opt(
        None, "SECONDS", "time from which events are counted [0; paper 0.01, nlcs 0.1]", show_default=False
    ),
    start_rows: int | None = opt(None, "scans per image (physical) [1]", min=1),
    disturbed: int | None = opt(None, "additional training scans per image, randomly disturbed (physical)", min=1),
    gains: str | None = opt(
        None, "GAIN,...", "also train on each recording at these gains [none; with groups: chosen by inner validation]"
    ),
    settings: list[str] | None = opt(None, "--set", "NAME=VALUE", "field of NetworkConfig or TrainConfig, repeatable"),
    grid: list[str] | None = opt(
        None, "--grid", "NAME=VALUE,...", "values to try, chosen by inner validation; repeatable"
    ),
) -> None:
    """Declare the options that define an experiment; this function is never called."""


OTHER_BIN = 1.5
"""Least ratio of two time bins that are compared."""

NOT_OF_A_SWEEP = ("encoding", "resolution", "events", "frames")
"""Options of an experiment that the points of a sweep replace."""


def with_experiment(command: Callable[..., Any]) -> Callable[..., Any]:
    """Replace the parameter ``make`` of a command by the options that define an Experiment.

    ``make`` is a ``Maker``. A parameter ``options`` instead receives the values of the options by name,
    without those that the points of a sweep say.
    """
    others = inspect.signature(_options, eval_str=True).parameters.values()
    options = [*READOUT, *(p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in others), *OWN]
    if "make" in inspect.signature(command).parameters:
        return replace_parameters(command, ["make"], options, lambda values: {"make": Maker(values)})
    kept = [option for option in options if option.name not in NOT_OF_A_SWEEP]
    return replace_parameters(command, ["options"], kept, lambda values: {"options": values})


@dataclasses.dataclass(frozen=True)
class Maker:
    """Make the experiment for the options of a command."""

    values: dict[str, Any]

    def __call__(self, fit: Fit | None = None) -> Experiment:
        """Return the experiment; raise an error for settings that the network lacks. ``fit`` is for recordings."""
        from eskin.snn.experiments.settings import idle_settings

        made = build_experiment(self.values, fit)
        kind, idle = idle_settings(made, self.values["settings"])
        if idle:
            raise InputError(f"{idle[0]} has no effect on a network of kind {kind}; leave it out")
        return made

    def variations(self, made: Experiment, data: ScanData, images: NDArray[np.int64]) -> list[Experiment]:
        """Return the experiments among which inner validation chooses, the default first.

        Where the user sets neither, they differ in time bins and learned decays. With few recordings, all learn decays,
        and they differ in time bins and windows. The training recordings ``images`` set time bins, batch and, without
        ``--epochs``, the epochs. Other experiments than those of ``--data`` do not vary.
        """
        from eskin.skin.recordings.event_files import bin_of_spectrum, seconds_of, signals_of
        from eskin.snn.experiments.inner import FEW
        from eskin.snn.experiments.recipes import UPDATES, batch_for, epochs_for, for_recordings
        from eskin.snn.experiments.settings import parse_settings
        from eskin.snn.training import parted

        if self.values["data"] is None or made.events is None:
            return [made]
        folder, recipe = Path(made.events), self.values["recipe"] or "skin"
        seconds = seconds_of(folder)
        assert seconds is not None, "recordings have samples"
        settings, scans = parse_settings(self.values["settings"] or []), len(data.scans_of(images))

        def sized(train: TrainConfig) -> TrainConfig:
            batch = train.batch if "batch" in settings else batch_for(scans * train.windows)
            epochs = train.epochs if self.values["epochs"] else epochs_for(scans, train.windows, batch, UPDATES)
            return dataclasses.replace(train, batch=batch, epochs=epochs)

        made = dataclasses.replace(made, train=sized(made.train))
        if made.frames is not None:
            return [made]
        bins = [made.bins.bin_s]
        if self.values["bin_s"] is None:
            codes, rate_hz = signals_of(folder)
            other = bin_of_spectrum([codes[data.names[image]] for image in images], rate_hz)
            for one in [2 * other, other] if other < bins[0] else [other]:  # noise moves the edge of a spectrum up
                bins += [one] if all(max(one / bin_s, bin_s / one) > OTHER_BIN for bin_s in bins) else []
        few, learns = len(images) <= FEW, recipe == "skin" and "learn_decay" not in settings
        found = []
        for learned in ([True] if few else [False, True]) if learns else [False]:
            for bin_s, halves in itertools.product(bins, [False, True] if few else [False]):
                follows = for_recordings(recipe, seconds, bin_s) | ({"learn_decay": True} if learned else {})
                if halves:
                    half = int(seconds.min() / bin_s) // 2
                    if not half or "window_steps" in follows | settings:
                        continue
                    follows |= {"window_steps": half, "windows": 2}
                network, training = parted(follows | settings)
                training.pop("batch", None)
                found.append(
                    dataclasses.replace(
                        made,
                        bins=dataclasses.replace(made.bins, bin_s=bin_s),
                        network=made.network | network,
                        train=sized(dataclasses.replace(made.train, **training)),
                    )
                )
        return found


def build_experiment(options: dict[str, Any], fit: Fit | None = None) -> Experiment:
    """Return the experiment for the options of a command.

    Options are the values by name of all parameters of ``_options``, and texts of the fields of Preparation. For
    recordings, ``fit`` chooses encoder, resolution and scale as in ``kept_events``; for frames only the scale.
    """
    from eskin.skin.recordings.fitting import Fit
    from eskin.snn.data.bins import BinConfig
    from eskin.snn.experiments.settings import experiment_of, parse_grid, parse_settings

    recipe = options["recipe"] or ("tuned" if options["data"] is None else "skin")
    if recipe not in RECIPES:
        raise InputError(f"recipe must be one of {', '.join(RECIPES)}, not {recipe!r}")
    for other, names in WITHOUT_EFFECT.items():
        if idle := [_NAMES.get(name, name) for name in names.split() if options[other] and options[name] is not None]:
            raise InputError(f"--{idle[0]} has no effect with --{other}; leave one of the two out")
    texts = {name: options[name] for name in ENCODER}
    readout, given = build_config(parse_fields(ReadoutConfig, texts), None, options["config_file"])
    if "resolution" not in given:
        readout = readout.replace(resolution=DEFAULT_RESOLUTION)
    tau_s = options["tau"]
    if tau_s is not None and (options["data"] is None or "encoding" in given):
        check_leaks(readout)
    prepared = parse_fields(Preparation, {name: options[name] for name in PREPARATION})
    follows: dict[str, Any] = {}
    if options["data"] is not None:
        if options["gains"] is not None:
            prepared["gains"] = parse_gains(options["gains"])
        fixed = given | ({"scale", "baseline", "gains"} & set(prepared))
        fixed = fixed if options["frames"] is None else fixed | {"encoding", "resolution", "baseline", "gains"}
        fit = dataclasses.replace(fit or Fit(), tau_s=tau_s)
        folder = events_of(options["data"], {"strict": True} | prepared, readout, fixed, fit=fit)
        tau_s = None  # the readout of the event files has it
        options = options | {"events": folder, "bin_s": options["bin_s"] or _bin_of(folder)}
        bin_s = options["bin_s"] or BinConfig().bin_s
        if options["frames"] is not None:
            bin_s = FrameSteps.parse(options["frames"], bin_s).step_s
        follows = _following(recipe, folder, bin_s)
    elif options["gains"] is not None or ("sample_rate_hz" in given and options["config_file"] is None):
        name = "--sample-rate" if options["gains"] is None else "--gains"
        raise InputError(f"{name} needs your own recordings; name their folder with --data DIR")
    else:
        check_alone(None, prepared, {})
    bins = BinConfig(start_s=options["start"])
    bins = bins if options["bin_s"] is None else dataclasses.replace(bins, bin_s=options["bin_s"])
    return experiment_of(
        recipe,
        follows | parse_settings(options["settings"] or []),
        options["epochs"] or EPOCHS,
        bins,
        options["frames"],
        events=None if options["events"] is None else str(options["events"]),
        readout=readout,
        tau_s=tau_s,
        given_leak=readout.encoder.leaks and bool(given & {"leak_shift", "leak_period"}),
        grid=parse_grid(options["grid"]) if options.get("grid") else None,
        taxels=choose(options["taxels"], readout.rows, readout.columns) if options["taxels"] else None,
        variant=options.get("variant"),
        tests=tuple(options.get("tests") or ()),
        **{name: options[name] for name in ("dataset", "preset", "start_rows", "disturbed")},
    )


def _following(recipe: str, folder: Path, bin_s: float) -> dict[str, Any]:
    """Return the parameters that depend on the lengths of a user's recordings, and print the chosen windows."""
    from eskin.skin.recordings.event_files import seconds_of
    from eskin.snn.experiments.recipes import for_recordings

    seconds = seconds_of(folder)
    if seconds is None:
        return {}
    found = for_recordings(recipe, seconds, bin_s)
    if "window_steps" in found:
        print(
            f"recordings last {seconds.min():.3g} to {seconds.max():.3g} s: an epoch uses {found['windows']} windows "
            f"of {found['window_steps'] * bin_s:.3g} s of each recording, and tests use whole recordings; "
            f"--set window_steps=0 trains on whole recordings"
        )
    return found


def _bin_of(folder: Path) -> float | None:
    """Return the sample period of recordings if it is longer than the default bin, else None."""
    from eskin.model.events.recording import Recording
    from eskin.snn.data.bins import BinConfig
    from eskin.snn.data.recordings import event_files

    period_s = 1 / Recording.load(event_files([folder])[0].path).config.sample_rate_hz
    if period_s <= BinConfig().bin_s:
        return None
    print(f"time bin: {period_s:.4g} s, the sample period of these recordings; --bin sets another time bin")
    return period_s


def parse_gains(text: str) -> tuple[float, ...]:
    """Return the gains in a text such as ``0.7,1.4``, or no gain for ``none``."""
    try:
        return () if text == "none" else tuple(map(float, text.split(",")))
    except ValueError:
        raise InputError(f"--gains needs numbers such as 0.7,1.4, or none, not {text!r}") from None


def check_device(device: str, threads: int) -> None:
    """Configure torch, and check that the device exists."""
    import torch

    torch.set_num_threads(threads)
    try:
        float(torch.zeros(1, device=device))
    except (RuntimeError, AssertionError, NotImplementedError):
        raise InputError(f"device {device!r} is not available here; use cpu") from None


def output_folder(folder: Path, *names: str) -> None:
    """Create an output folder, and check that files can be written there, before any work."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        check_file(folder / name)
    if not os.access(folder, os.W_OK):
        raise InputError(f"cannot write into {folder}; choose another folder with --out")
