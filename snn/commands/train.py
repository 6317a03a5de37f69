"""The commands train and crossval (docs/guide/classifier.md)."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from model.cli.app import printable
from model.cli.progress import bar
from model.errors import InputError
from model.files import write_json
from snn.commands.bars import epoch_bar
from snn.commands.options import Folds, Seeds, Workers, check_device, output_folder, with_experiment

if TYPE_CHECKING:
    from snn.data.scans import Split
    from snn.experiments.experiment import Experiment
    from snn.training import Epoch, Training


@with_experiment
def train(
    made: Any,
    folds: Folds = 6,
    fold: Annotated[int, typer.Option(min=0, help="the fold that is tested, from 0")] = 0,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="of weights, order and augmentation")] = 0,
    checkpoint_every: Annotated[int, typer.Option(min=1, help="epochs between checkpoints")] = 5,
    threads: Annotated[int, typer.Option(min=1, help="threads of torch")] = 1,
    device: Annotated[str, typer.Option(help="as torch names it")] = "cpu",
    watch_test: Annotated[
        bool, typer.Option("--watch-test", help="also note the test accuracy of every epoch; it selects nothing")
    ] = False,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="checkpoint and result")] = Path("out/train"),
) -> None:
    """Train one network on one fold; stopped, it goes on from its checkpoint when called again."""
    import numpy as np

    check_device(device, threads)
    if made.grid is not None:
        raise InputError("train takes one setting; give it with --set, or the grid to crossval or sweep")
    if fold >= folds:
        raise InputError(f"fold must be in 0..{folds - 1}, not {fold}")
    output_folder(out, "checkpoint.pt", "result.json", "weights.npz")
    with bar("recording scans") as step:
        data = made.data(step)
    from snn.checkpoint import Checkpoint
    from snn.data.folds import stratified_folds
    from snn.data.recordings import own_readout
    from snn.data.scans import Split
    from snn.exchange.weights import Weights, save_weights
    from snn.kernels import cpu as kernel
    from snn.train import predicted_classes

    labels = data.image_labels
    test = stratified_folds(labels, folds)[fold]
    images = np.setdiff1d(np.arange(len(labels)), test)
    print(f"data: {printable(data.source)}")
    print(
        f"{len(images)} images to learn ({len(data.scans_of(images))} scans), {len(test)} to test, "
        f"{len(data.class_names)} classes; {data.steps} steps of {data.channels} channels"
    )
    if not kernel.available():
        print("no C++ compiler was found: the dense torch path is used, about five times slower")
    checkpoint = Checkpoint(out / "checkpoint.pt", checkpoint_every)
    training = _learn(
        made, Split(data, images, test if watch_test else None), seed, checkpoint=checkpoint, device=device
    )
    predicted = predicted_classes(training.network, data, test, device)
    accuracy = float((predicted == labels[test]).mean())
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
    if made.events and (own := own_readout(Path(made.events))):
        result["recordings"] = own.to_dict()
    write_json(out / "result.json", result)
    save_weights(out / "weights.npz", Weights(training.network, data.class_names, data.step_s))
    last = training.history[-1]
    print(f"after epoch {last.number}: loss {last.loss:.3f}, accuracy of the training scans {last.accuracy:.1%}")
    print(f"test accuracy {accuracy:.1%} ({(predicted == labels[test]).sum()} of {len(test)} images), last epoch")
    if watch_test:
        best = max(training.history, key=lambda epoch: epoch.held_out or 0.0)
        print(f"the best test epoch, no result as it is chosen by the test: {best.held_out:.1%}, epoch {best.number}")
    print(f"result: {out / 'result.json'}, weights: {out / 'weights.npz'}")


def _learn(made: Experiment, split: Split, seed: int, **options: Any) -> Training:
    """Train with a bar of epochs; every sign of divergence is told once."""
    from snn.train import train as learn

    network = made.network_config(split.data)
    told: set[str] = set()
    with epoch_bar(made.train.epochs) as (show, say):

        def progress(epoch: Epoch) -> None:
            show(epoch)
            for warning in epoch.warnings(network.kind == "spiking", network.classes):
                kind = warning.split("(")[0][:20]
                if kind not in told:
                    told.add(kind)
                    say(f"epoch {epoch.number}: {warning}")

        return learn(split, network, made.train, seed, progress=progress, **options)


@with_experiment
def crossval(
    made: Any,
    folds: Folds = 6,
    seeds: Seeds = 3,
    workers: Workers = None,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="one file per cell, and the report")] = Path(
        "out/crossval"
    ),
) -> None:
    """Cross-validate a network: folds x seeds; stopped, it goes on with the cells that are missing."""
    check_device("cpu", 1)
    output_folder(out, "result.json")
    with bar("recording scans") as step:
        data = made.data(step)
    from snn.experiments.sweep import cross_validate

    with bar("cells", folds * seeds) as step:
        report = cross_validate(
            made, out, folds=folds, seeds=seeds, workers=workers, data=data, progress=lambda _: step()
        )
    for reading, words in (("last", "last epoch"), ("selected", "epoch selected by inner validation")):
        found = report[reading]
        low, high = found["bootstrap_95"]
        print(
            f"{words}: {found['accuracy']:.1%}, 95 % interval over images and seeds {low:.1%} to {high:.1%} "
            f"({found['images']} images, {seeds} seeds), standard deviation over cells {found['sd_over_cells']:.1%}"
        )
    print(f"result: {out / 'result.json'}")
