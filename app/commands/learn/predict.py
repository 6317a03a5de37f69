"""The command predict (docs/guide/classifier.md)."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.app.cli import echo, printable
from eskin.app.commands import common
from eskin.app.commands.signals.recordings import events_of, named_place
from eskin.app.options import TRAINED, arg, command, opt, out_file
from eskin.base.errors import InputError
from eskin.base.files import write_json
from eskin.base.progress import bar
from eskin.base.units import counted

if TYPE_CHECKING:
    from eskin.model.events.recording import Recording
    from eskin.snn.experiments.evaluate import Check
    from eskin.snn.experiments.trained import Trained

MAX_LINES = 20  # recordings listed one by one; of more, only those without a class
MAX_CLASSES = 12  # classes of a printed confusion matrix


@command(
    "Classifier",
    needs="snn",
    fuzz="good/train/weights.npz --events good/events.npz -o new.json",
    idle={
        "no --check-model": "--dataset",
    },
)
def predict(
    weights: Path = arg(TRAINED, "WEIGHTS.npz", "trained network, or the integer network of eskin quantise"),
    events: list[Path] | None = opt(
        None, "--events", "DIR|FILE", "event files, also of other programs; repeatable [out/replay, or those of --data]"
    ),
    address_map: Path | None = opt(
        None, "--map", "FILE", "events of other programs: .csv with the taxel of each address"
    ),
    data: Path | None = opt(None, "DIR|FILE", "your own recordings, prepared as in the training", callback=named_place),
    check_model: bool = opt(
        False, "--check-model", "compare RTL recordings with the model; exit code 1 if they differ"
    ),
    dataset: str | None = opt(
        None, "DIR|embedded", "textures of the recordings [$ESKIN_DATA, data/kylberg; else embedded]"
    ),
    metrics: bool = opt(
        False, "--metrics", "print NeuroBench's metrics: footprint, sparsities and synaptic operations of a recording"
    ),
    out: Path = out_file(Path("out/predictions.json"), "FILE", "file for the predictions"),
) -> None:
    """Classify recordings with a trained network."""
    import torch

    from eskin.skin.foreign.address_map import AddressMap
    from eskin.skin.foreign.files import is_foreign
    from eskin.snn.data.recordings import event_files, read_recordings
    from eskin.snn.exchange.neurobench import measure
    from eskin.snn.exchange.weights import Weights
    from eskin.snn.experiments import evaluate as work
    from eskin.snn.experiments.trained import load_trained

    torch.set_num_threads(1)
    if events and data is not None and not check_model:
        raise InputError(
            "--data with --events only names the samples for --check-model; add --check-model, or leave --data out"
        )
    trained = load_trained(weights)
    if metrics and not isinstance(trained.weights, Weights):
        raise InputError(f"--metrics needs the float weights, and {weights} is an integer network; leave --metrics out")
    if not events and data is None and trained.own is None:
        events = [Path("out/replay")]
    files = event_files(events or [_own_events(trained, data, check_model)])
    mapping = AddressMap.read(address_map) if address_map is not None else None
    if mapping is not None and not any(is_foreign(file.path) for file in files):
        raise InputError("--map is for foreign event files, but there is no such file; leave --map out")
    with bar("reading events", len(files)) as step:
        recordings = read_recordings(files, trained.weights.class_names, step, mapping)
    if not events:
        recordings = [work.without_unknown_class(recording, trained) for recording in recordings]
    counts = work.bin_recordings(recordings, trained)
    logits, early = work.answers(trained, counts)
    scores = work.scores(recordings, counts, logits, trained)
    found = counted(len(counts), "recording")
    print(f"{found}; {counts.steps} steps of {counts.channels} channels, {counts.step_s:g} s each")
    if other := trained.other_fields(recordings[0].config):
        print(f"warning: the readout differs from the readout of the training: {'; '.join(other)}", file=sys.stderr)
    check = None
    if check_model:
        with bar("model", len(files)) as step:
            check = work.check_model(recordings, counts, logits, trained, dataset, data, step)
    report = work.predictions(recordings, logits, trained, scores, check, early)
    _print_recordings(report["images"])
    _print_scores(scores, trained)
    if metrics:
        assert isinstance(trained.weights, Weights)
        report["metrics"] = measure(trained.weights.network, counts)
        _print_metrics(report["metrics"])
    write_json(out, report)
    echo(f"predictions: {out}")
    _write_over_time(report, out)
    if check is not None:
        again = ["eskin", "predict", str(weights), "--events", str(files[check.where].path)]
        again += ["--check-model", *([] if dataset is None else ["--dataset", dataset])]
        again += [] if data is None else ["--data", str(data)]
        _print_check(check, recordings, shlex.join(again))


def _write_over_time(report: dict[str, Any], out: Path) -> None:
    """Write the classes of windows over time, as a table and as a picture."""
    from eskin.snn.figures.over_time import over_time, plot_over_time, write_over_time

    if windows := over_time(report["images"]):
        table, picture = out.with_suffix(".csv"), out.with_suffix(".png")
        write_over_time(windows, table)
        plot_over_time(windows, report["class_names"], picture)
        echo(f"classes over time: {table}, {picture}")


def _own_events(trained: Trained, data: Path | None, check_model: bool) -> Path:
    """Return the event files of a user's recordings, prepared as in the training."""
    from eskin.skin.recordings.trained_on import EVERY_FIELD

    if data is None:
        raise InputError(
            "the network was trained on recordings; give recordings with --data DIR, or event files with --events DIR"
        )
    if check_model:
        raise InputError(
            "--check-model compares events of the RTL with the model; add --events, as from eskin replay --data"
        )
    if trained.own is None:
        raise InputError(
            "the network was not trained on recordings, so their scale is unknown; encode them with eskin "
            "encode, and give --events"
        )
    return events_of(data, trained.own.prepared, trained.own.config, EVERY_FIELD, flat=True)


def _print_check(check: Check, recordings: Sequence[Recording], again: str) -> None:
    """Print how many RTL recordings equal the model; exit with 1 if a recording differs or none exists."""
    from eskin.snn.experiments.evaluate import LEVELS

    names = [recording.metadata["name"] for recording in recordings]
    noun = "images" if len(set(names)) == len(names) else "recordings"
    count = len(check.compared)
    if not count:
        common.fail(f'FAILED: nothing was compared, none of {len(recordings)} recordings has the source "rtl"')
    if not check.passed:
        print("\n".join(map(printable, [*check.first.splitlines(), f"reproduce: {again}"])))
        differ = ", ".join(f"{len(numbers)} in {level}" for level, numbers in check.different.items())
        common.fail(f"FAILED: {count} {noun} compared, different: {differ}")
    if count < len(recordings):
        print(f"{len(recordings) - count} recordings do not come from the RTL and were not compared")
    same = ", ".join(f"same {level}" for level in LEVELS)
    print(f"{count} of {count} {noun}: {same} ({check.events} events)")


def _print_metrics(found: dict[str, Any]) -> None:
    """Print NeuroBench's metrics."""
    work = found["synaptic_operations"]
    print(
        f"footprint {found['footprint_bytes']} bytes; sparsity of connections {found['connection_sparsity']:.3f}, of "
        f"activations {found['activation_sparsity']:.3f}; synaptic operations of a recording: "
        f"{work['Effective_MACs']:,.0f} MACs, {work['Effective_ACs']:,.0f} ACs, {work['Dense']:,.0f} dense"
    )


def _print_recordings(images: Sequence[dict[str, Any]]) -> None:
    """Print the predictions of recordings; skip recordings with a class if the list is long.

    A list is long with more than ``MAX_LINES`` recordings.
    """
    for image in images:
        if len(images) <= MAX_LINES or image["class"] is None:
            said = f"{image['predicted']} (class: {image['class'] or 'not known'})"
            echo(f"{image['name']}: {said}{common.early_text(image)}")
    if "early" in images[0] and (known := [image for image in images if image["class"] is not None]):
        right = sum((image["early"] or image["predicted"]) == image["class"] for image in known)
        decided = sum(image["early"] is not None for image in known)
        print(f"early decisions: {right} of {len(known)} right; {decided} reached the margin")


def _print_scores(scores: dict[str, dict[str, Any]], trained: Trained) -> None:
    """Print the accuracy of each group, and the confusion matrix of the test group."""
    from eskin.snn.experiments.trained import OTHER, TEST, TRAINING

    noun = "recordings" if trained.of_recordings else "images"
    words = {
        TEST: f"test {noun} of the fold",
        TRAINING: f"training {noun} (used in the training: not a valid result)",
        OTHER: f"{noun} not used in the training" if trained.parts else f"all {noun}",
    }
    for part, score in scores.items():
        print(f"{words[part]}: accuracy {score['accuracy']:.1%} ({score['correct']} of {score['images']})")
    if scores and not trained.parts:
        print(f"the network may have learned some of them: {printable(trained.unknown)}")
    shown = scores.get(TEST) or scores.get(OTHER)
    names = [printable(name) for name in trained.weights.class_names]
    if shown is None or len(names) > MAX_CLASSES:
        return
    width = max(map(len, names)) + 2
    print("predicted:".ljust(width) + "".join(name.rjust(width) for name in names))
    for name, row in zip(names, shown["confusion"], strict=True):
        print(name.ljust(width) + "".join(str(number).rjust(width) for number in row))
