"""The commands train and crossval (docs/guide/classifier.md)."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import shlex
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.app.cli import echo, printable
from eskin.app.commands import common
from eskin.app.commands.learn.options import Folds, Seeds, Workers, check_device, output_folder, with_experiment
from eskin.app.commands.signals.recordings import scale_text
from eskin.app.options import command, opt, out_folder
from eskin.base.errors import InputError
from eskin.base.files import read_json
from eskin.base.progress import SILENCE_S, bar, progress_of, watched
from eskin.base.workers.engine import open_pool

if TYPE_CHECKING:
    from eskin.app.commands.learn.options import Maker
    from eskin.snn.data.scans import ScanData
    from eskin.snn.experiments.experiment import Experiment
    from eskin.snn.experiments.single import Fold
    from eskin.snn.training import Epoch, Training


OUT = Path("out/train")
FILES = ("checkpoint.pt", "result.json", "weights.npz")


@command("Classifier", needs="snn", fuzz="--events good/events --folds 2 --fold 9", idle={"--test": "--fold --folds"})
@with_experiment
def train(
    make: Any,  # a Maker
    folds: Folds = 6,
    fold: int = opt(0, "test fold, from 0", min=0),
    test: str | None = opt(
        None, "PATTERN", "test the recordings whose names match a pattern such as '*_1', instead of a fold"
    ),
    every: bool = opt(
        False, "--all", "after the test, train the delivered network on all recordings; the tested one is in DIR/tested"
    ),
    seed: int = opt(0, "seed of weights, order and augmentation", min=0, max=2**32 - 1),
    checkpoint_every: int = opt(5, "epochs between checkpoints", min=1),
    threads: int = opt(1, "threads of torch", min=1),
    device: str = opt("cpu", "device name of torch"),
    watch_test: bool = opt(
        False, "--watch-test", "also store the test accuracy of every epoch (not used to select an epoch)"
    ),
    out: Path | None = out_folder(
        None, "DIR", "checkpoint and result [out/train; another training: named for the run]"
    ),
) -> None:
    """Train a network on all folds except the test fold, and test the network on the test fold.

    A stopped training continues from its checkpoint.
    """
    check_device(device, threads)
    if fold >= folds:
        raise InputError(f"fold must be in 0..{folds - 1}, not {fold}")
    from eskin.snn.encoder_choice import EncoderChoice

    made: Experiment = make(EncoderChoice(fold=fold, folds=folds, test=test))
    if made.grid is not None:
        raise InputError("train needs a single value of each setting; use --set, or give the grid to crossval or sweep")
    chosen_out, out = out, out or OUT
    tested = "tested" if every else ""
    output_folder(out / tested, *FILES)
    with bar("recording scans") as step:
        data = made.data(step)
    from eskin.snn.checkpoint import Checkpoint, OtherTraining
    from eskin.snn.experiments.single import Fold, check_whole, train_fold, train_whole
    from eskin.snn.figures.training import draw_training

    chosen = Fold.choose(data, fold, folds) if test is None else Fold.named(data, test)
    noun = "images" if made.events is None else "recordings"
    _print_data(chosen, folds, noun)
    made, chosen, more = _chosen(make, made, chosen, seed)
    data = chosen.data
    options: dict[str, Any] = {"device": device, "watch_test": watch_test, "more": more}

    def kept(out: Path) -> Checkpoint:
        return Checkpoint(out / "checkpoint.pt", checkpoint_every)

    def on_fold(out: Path) -> tuple[Training, dict[str, Any]]:
        if every:  # before a long training
            check_whole(made, data, seed, kept(out))
        return train_fold(made, chosen, seed, kept(out / tested), progress=progress, **options)

    with _epochs(made, data) as progress:
        try:
            training, result = on_fold(out)
        except OtherTraining:
            if chosen_out is not None:
                raise
            out = OUT.with_name(_name_of(made, chosen, seed, every))
            echo(f"{OUT} holds another training; this one goes to {out}", file=sys.stderr)
            output_folder(out / tested, *FILES)
            training, result = on_fold(out)
    _print_result(training, result, data, noun)
    if watch_test:
        best = max(training.history, key=lambda epoch: epoch.held_out or 0.0)
        print(f"best test epoch {best.number}: {best.held_out:.1%} (no valid result: the test images chose the epoch)")
    pictures = draw_training(result, [data.names[number] for number in chosen.test], out / tested)
    if every:
        print(f"training on all {len(data.names)} {noun}")
        with _epochs(made, data) as progress:
            train_whole(made, data, seed, kept(out), result, device=device, progress=progress)
    echo(f"result: {out / 'result.json'}, weights: {out / 'weights.npz'}")
    echo(f"{'picture' if len(pictures) == 1 else 'picture and page'}: {', '.join(map(str, pictures))}")
    _print_next(made, out)


def _print_next(made: Experiment, out: Path) -> None:
    """Print the command that takes the weights further."""
    if made.frames is None:
        place = str(out / "weights.npz")
        words = ["export", place, "-o", str(out / "network.nir")]
        if made.events is not None:
            words = ["quantise", place]
        print(f"next: {shlex.join(['eskin', *words])}")


def _print_data(chosen: Fold, folds: int, noun: str) -> None:
    """Print numbers and classes of the training and test images."""
    from eskin.snn.kernels import cpu as kernel

    data = chosen.data
    print(f"data: {printable(data.source)}")
    if 1 < chosen.of < folds:
        grouped = " groups of" if data.groups else ""
        print(
            f"{chosen.of} folds instead of {folds}: a class has only {chosen.of}{grouped} recordings; "
            f"--folds sets another number"
        )
    print(
        f"{len(chosen.images)} {noun} for training ({len(data.scans_of(chosen.images))} scans), {len(chosen.test)} "
        f"for testing, {len(data.class_names)} classes; {data.steps} steps of {data.channels} channels"
    )
    echo(f"classes: {', '.join(data.class_names[:8])}{', ...' if len(data.class_names) > 8 else ''}")
    if not kernel.available():
        print("no C++ compiler was found: the dense torch path is used, about five times slower")


def _chosen(make: Maker, made: Experiment, fold: Fold, seed: int) -> tuple[Experiment, Fold, dict[str, Any]]:
    """Return experiment and fold with the settings that inner validation chooses, and all scores."""
    from eskin.skin.recordings.event_files import CHOICE
    from eskin.snn.experiments.inner import choose, described

    tried = make.variations(made, fold.data, fold.images)
    data = {made.bins: fold.data}

    def data_of(one: Experiment) -> ScanData:
        if one.bins not in data:
            data[one.bins] = one.data()
        return data[one.bins]

    made, scores = choose(tried, data_of, fold.images, seed)
    more: dict[str, Any] = {}
    if scores:
        more["inner"] = scores
        print(f"chosen: {described(made)}; --bin, --set learn_decay and --set window_steps fix them")
    if make.values["data"] is not None and made.events is not None:
        more["choice"] = read_json(Path(made.events) / CHOICE, "the scores of the settings", dict)["scores"]
    return made, dataclasses.replace(fold, data=data_of(made)), more


def _print_result(training: Training, result: dict[str, Any], data: ScanData, noun: str) -> None:
    """Print readout and scale of recordings, the test accuracy, and the accuracy of baseline classifiers."""
    from eskin.skin.recordings.trained_on import OwnReadout
    from eskin.snn.experiments.intervals import sentences
    from eskin.snn.reference import is_unbalanced

    last, labels = training.history[-1], result["labels"]
    right = sum(a == b for a, b in zip(result["predicted"], labels, strict=True))
    if "recordings" in result:
        own = OwnReadout.from_dict(result["recordings"])
        events = f"{own.config.encoding} {own.config.resolution} b, " if result["experiment"]["frames"] is None else ""
        print(f"readout: {events}{scale_text(own.options.factors())}")
    print(f"after epoch {last.number}: loss {last.loss:.3f}, accuracy of the training scans {last.accuracy:.1%}")
    unbalanced = is_unbalanced(data.image_labels)
    more = f", balanced {result['balanced_accuracy']:.1%}" if unbalanced else ""
    print(f"test accuracy {result['accuracy']:.1%} ({right} of {len(labels)} {noun}{more}), last epoch")
    if "references" in result:
        for line in sentences(result, unbalanced):
            print(line)


def _name_of(made: Experiment, fold: Fold, seed: int, every: bool) -> str:
    """Return a folder name for a training: data, readout, and a digest of all settings."""
    own = made.to_dict() | {"tested": fold.test.tolist(), "seed": seed, "names": fold.data.names}
    own |= {"all": True} if every else {}
    digest = hashlib.sha256(json.dumps(own, sort_keys=True, default=str).encode()).hexdigest()[:6]
    what, readout = made.preset, made.readout
    if made.events is not None:
        what, readout = "recordings", made.with_readout_of_events().readout
    return f"train-{what}-{readout.encoding}-{readout.resolution}b-{digest}"


@contextmanager
def _epochs(made: Experiment, data: ScanData) -> Iterator[Callable[[Epoch], None]]:
    """Yield a function that reports an epoch, and prints each kind of warning once on standard error.

    Without a terminal, every tenth epoch is printed, and one whenever ``SILENCE_S`` have passed.
    """
    network, epochs, told = made.network_config(data), made.train.epochs, set[str]()

    def warnings(epoch: Epoch) -> Iterator[str]:
        for warning in epoch.warnings(network.kind == "spiking", network.classes):
            kind = warning.split("(")[0][:20]
            if kind not in told:
                told.add(kind)
                yield f"warning: epoch {epoch.number}: {warning}"

    said_at = time.monotonic()

    def line(epoch: Epoch) -> None:
        nonlocal said_at
        if epoch.number % 10 == 0 or epoch.number == epochs or time.monotonic() - said_at > SILENCE_S:
            said_at = time.monotonic()
            words = f"loss {epoch.loss:.3f}, training accuracy {epoch.accuracy:.1%}"
            print(f"epoch {epoch.number}/{epochs}: {words}", flush=True)
        for warning in warnings(epoch):
            print(warning, file=sys.stderr)

    if not watched():
        yield line
        return
    words = "loss {task.fields[loss]:.3f}, training accuracy {task.fields[accuracy]:.1%}"
    with progress_of("epochs", words, time_left=True) as shown:
        task = shown.add_task("", total=epochs, loss=float("nan"), accuracy=0.0)

        def show(epoch: Epoch) -> None:
            shown.update(task, completed=epoch.number, loss=epoch.loss, accuracy=epoch.accuracy)
            for warning in warnings(epoch):
                shown.console.print(warning, markup=False)

        yield show


@command("Classifier", needs="snn", fuzz="--events good/events --folds 99")
@with_experiment
def crossval(
    make: Any,
    folds: Folds = 6,
    seeds: Seeds = 3,
    workers: Workers = None,
    scheduler: common.Scheduler = None,
    out: Path = out_folder(Path("out/crossval"), "DIR", "folder for the report, and the results so far"),
) -> None:
    """Cross-validate a network over all folds and several seeds.

    A stopped run continues with the missing folds and seeds.
    """
    made: Experiment = make()
    check_device("cpu", 1)
    output_folder(out, "result.json")
    with bar("recording scans") as step:
        data = made.data(step)
    from eskin.snn.experiments.sweep import NEEDS, cross_validate

    with common.resumable(out), open_pool(workers, scheduler, NEEDS) as pool, bar("cells", folds * seeds) as step:
        report = cross_validate(made, out, pool=pool, folds=folds, seeds=seeds, data=data, progress=lambda _: step())
    for reading, words in (("last", "last epoch"), ("selected", "epoch selected by inner validation")):
        found = report[reading]
        low, high = found["bootstrap_95"]
        print(
            f"{words}: {found['accuracy']:.1%}, 95 % interval over images and seeds {low:.1%} to {high:.1%} "
            f"({found['images']} images, {seeds} seeds), standard deviation over cells {found['sd_over_cells']:.1%}"
        )
    print(f"result: {out / 'result.json'}")
