"""The commands train and crossval (docs/classifier.md)."""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_type_hints

import typer

from model.cli import build_config
from model.errors import InputError

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
Recipe = Annotated[str, typer.Option(metavar="plain|paper|tuned", help="fields to start from: docs/classifier.md")]
Folds = Annotated[int, typer.Option(help="stratified folds")]

DEFAULT_RESOLUTION = 4

RECIPES: dict[str, dict[str, Any]] = {
    "plain": {},
    "paper": {"output_scale": 0.1, "cosine": True, "shift_steps": 10},
    "tuned": {
        "input_scale": 0.4,
        "decay": 0.8,
        "output_decay": 0.95,
        "readout": "membrane",
        "dropout": 0.3,
        "weight_decay": 0.01,
        "cosine": True,
        "shift_steps": 20,
    },
}
"""Fields of NetworkConfig and TrainConfig by name of the recipe: the paper's network without and with what helps its
training, and a leaky variant whose outputs do not fire."""


def train(
    preset: Preset = "physical",
    encoding: Encoding = None,
    resolution: Resolution = None,
    tau: Tau = None,
    config_file: ConfigFile = None,
    dataset: DatasetName = None,
    events: EventFolder = None,
    frames: Frames = 0,
    start_rows: StartRows = 1,
    bin_s: BinSeconds = 0.002,
    recipe: Recipe = "tuned",
    epochs: Epochs = 60,
    settings: Settings = None,
    folds: Folds = 6,
    fold: Annotated[int, typer.Option(min=0, help="the fold that is tested, from 0")] = 0,
    seed: Annotated[int, typer.Option(min=0, help="of weights, order and augmentation")] = 0,
    checkpoint_every: Annotated[int, typer.Option(min=1, help="epochs between checkpoints")] = 5,
    threads: Annotated[int, typer.Option(min=1, help="threads of torch")] = 1,
    device: Annotated[str, typer.Option(help="as torch names it")] = "cpu",
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="checkpoint and result")] = Path("out/train"),
) -> None:
    """Train one network on one fold; stopped, it goes on from its checkpoint when called again."""
    import numpy as np

    made = _experiment(locals())
    _check_device(device, threads)
    with _bar("recording scans") as step:
        data = made.data(step)
    from snn import kernel
    from snn.exchange import Weights, save_weights
    from snn.experiment import stratified_folds
    from snn.train import Epoch, predict
    from snn.train import train as learn

    labels = data.image_labels
    parts = stratified_folds(labels, folds)
    if fold >= folds:
        raise InputError(f"fold must be in 0..{folds - 1}, not {fold}")
    test = parts[fold]
    images = np.setdiff1d(np.arange(len(labels)), test)
    print(
        f"{len(images)} images to learn ({len(data.scans_of(images))} scans), {len(test)} to test, "
        f"{len(data.class_names)} classes; {data.steps} steps of {data.channels} channels"
    )
    if not kernel.available():
        print("no C++ compiler was found: the dense torch path is used, about five times slower")
    out.mkdir(parents=True, exist_ok=True)
    told: set[str] = set()
    network = made.network_config(data)
    with _epoch_bar(made.train.epochs) as (show, say):

        def progress(epoch: Epoch) -> None:
            show(epoch)
            for warning in epoch.warnings(network.kind == "spiking", network.classes):
                kind = warning.split("(")[0][:20]
                if kind not in told:
                    told.add(kind)
                    say(f"epoch {epoch.number}: {warning}")

        training = learn(
            data, images, network, made.train, seed,
            checkpoint=out / "checkpoint.pt", checkpoint_every=checkpoint_every, device=device, progress=progress,
        )  # fmt: skip
    predicted = predict(training.network, data, test, device)
    accuracy = float((predicted == labels[test]).mean())
    last = training.history[-1]
    result = {
        "experiment": made.to_dict(),
        "fold": fold,
        "folds": folds,
        "seed": seed,
        "class_names": list(data.class_names),
        "accuracy": accuracy,
        "labels": labels[test].tolist(),
        "predicted": predicted.tolist(),
        "history": [dataclasses.asdict(epoch) for epoch in training.history],
    }
    _write(out / "result.json", result)
    save_weights(out / "weights.npz", Weights(training.network, data.class_names, data.step_s))
    print(f"after epoch {last.number}: loss {last.loss:.3f}, accuracy of the training scans {last.accuracy:.1%}")
    print(f"test accuracy {accuracy:.1%} ({(predicted == labels[test]).sum()} of {len(test)} images), last epoch")
    print(f"result: {out / 'result.json'}, weights: {out / 'weights.npz'}")


def crossval(
    preset: Preset = "physical",
    encoding: Encoding = None,
    resolution: Resolution = None,
    tau: Tau = None,
    config_file: ConfigFile = None,
    dataset: DatasetName = None,
    events: EventFolder = None,
    frames: Frames = 0,
    start_rows: StartRows = 1,
    bin_s: BinSeconds = 0.002,
    recipe: Recipe = "tuned",
    epochs: Epochs = 60,
    settings: Settings = None,
    folds: Folds = 6,
    seeds: Annotated[int, typer.Option(min=1, help="seeds per fold")] = 3,
    workers: Annotated[int | None, typer.Option(min=1, help="processes of one thread [one per core]")] = None,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="one file per cell, and the report")] = Path(
        "out/crossval"
    ),
) -> None:
    """Cross-validate a network: folds x seeds; stopped, it goes on with the cells that are missing."""
    import os

    made = _experiment(locals())
    _check_device("cpu", 1)
    with _bar("recording scans") as step:
        data = made.data(step)
    from snn.crossval import cross_validate

    with _bar("cells", folds * seeds) as step:
        report = cross_validate(
            made, out, folds=folds, seeds=seeds, workers=workers or os.cpu_count() or 1, data=data,
            progress=lambda _: step(),
        )  # fmt: skip
    for reading, words in (("last", "last epoch"), ("selected", "epoch selected by inner validation")):
        found = report[reading]
        low, high = found["wilson_95"]
        deviation = found["sd_over_folds"]
        print(
            f"{words}: {found['accuracy']:.1%}, standard deviation over folds {deviation:.1%}, "
            f"95 % interval {low:.1%} to {high:.1%} ({found['images']} images, {seeds} seeds)"
        )
    print(f"result: {out / 'result.json'}")


# -- what both share ---------------------------------------------------------------------------------


def _experiment(options: dict[str, Any]) -> Experiment:
    """Return the experiment that the options of a command describe."""
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
    fields = RECIPES[options["recipe"]] | _parse_settings(options["settings"] or [])
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


def _parse_settings(texts: list[str]) -> dict[str, Any]:
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


def _check_device(device: str, threads: int) -> None:
    """Set torch up, and refuse a device that is not there."""
    import torch

    torch.set_num_threads(threads)
    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError, NotImplementedError):
        raise InputError(f"device {device} is not available here; use cpu") from None


@contextmanager
def _bar(text: str, total: int | None = None) -> Iterator[Any]:
    """Give a function to call after each piece of work; a bar on standard error if that is a terminal."""
    if not sys.stderr.isatty():
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(text, total=total)
        yield lambda: bar.advance(task)


@contextmanager
def _epoch_bar(epochs: int) -> Iterator[tuple[Any, Any]]:
    """Give functions to show an epoch and to say a sentence; without a terminal every tenth epoch is a line."""
    if not sys.stderr.isatty():

        def line(epoch: Any) -> None:
            if epoch.number % 10 == 0 or epoch.number == epochs:
                print(f"epoch {epoch.number}/{epochs}: loss {epoch.loss:.3f}, training accuracy {epoch.accuracy:.1%}")
                sys.stdout.flush()

        yield line, lambda text: print(f"warning: {text}", file=sys.stderr)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    words = TextColumn("loss {task.fields[loss]:.3f}, training accuracy {task.fields[accuracy]:.1%}")
    columns = (TextColumn("epochs"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), words)
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=epochs, loss=float("nan"), accuracy=0.0)
        yield (
            lambda epoch: bar.update(task, completed=epoch.number, loss=epoch.loss, accuracy=epoch.accuracy),
            lambda text: console.print(f"warning: {text}"),
        )


def _write(path: Path, content: dict[str, Any]) -> None:
    from model.files import atomic_write

    with atomic_write(path) as file:
        file.write((json.dumps(content, indent=1) + "\n").encode())
