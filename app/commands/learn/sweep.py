"""The command sweep (docs/guide/classifier.md)."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from eskin.app.cli import command_line, echo
from eskin.app.commands import common
from eskin.app.commands.learn.options import NOT_OF_A_SWEEP, Folds, Seeds, Workers, build_experiment, with_experiment
from eskin.app.options import LEAKY, command, opt, out_folder
from eskin.app.tables import print_table
from eskin.base.errors import InputError
from eskin.base.progress import progress_of, watched
from eskin.base.workers.engine import open_pool
from eskin.snn.data.frame_steps import FRAMES, FrameKind, FrameSteps
from eskin.snn.experiments.recipes import BASELINES

if TYPE_CHECKING:
    from eskin.snn.experiments.points import Point
    from eskin.snn.experiments.sweep import PointRun, SweepPoint

DEFAULT_POINTS = "lcs:2,lcs:4,lcs:6,lcs:8,nlcs:4,nlcs:6,nlcs:8,nlcs:10"

UNSAID: dict[str, Any] = dict.fromkeys(NOT_OF_A_SWEEP)  # options that a point does not set


@command(
    "Classifier",
    needs="snn",
    fuzz="--points lcs:4,lcs:4 -o new",
    idle={
        "--events": "--points",
        "--test": "--folds",
    },
)
@with_experiment
def sweep(
    *,
    points: str = opt(
        DEFAULT_POINTS, "ENCODER:N,...", f"N bits; {FRAMES}; rnn|gru|cnn:K, K frames of 5 kHz x 10 b a step"
    ),
    events: list[Path] | None = opt(
        None, "--events", "DIR", "folder of event files as a point, instead of --points; repeatable"
    ),
    options: dict[str, Any],
    folds: Folds = 6,
    tests: list[str] | None = opt(
        None, "--test", "PATTERN", "a fold that tests the recordings with such names, as '*_1'; repeatable"
    ),
    seeds: Seeds = 3,
    workers: Workers = None,
    scheduler: common.Scheduler = None,
    out: Path = out_folder(Path("out/sweep"), "DIR", "parent folder of a folder per point and of sweep.json"),
) -> None:
    """Cross-validate networks for many readouts and resolutions.

    A stopped run continues with the missing folds and seeds.
    """
    from eskin.snn.experiments.settings import parse_points

    chosen = [] if events else parse_points(points)
    if tests:
        options, folds = options | {"tests": tests}, len(tests)
    if not events and options["tau"] is not None and not {readout for readout, _ in chosen} & set(LEAKY):
        named = " or ".join(LEAKY)
        raise InputError(f"--tau is the leak of {named}, but --points has no {named} point; leave it out")
    if not events and options["bin_s"] is not None and not {readout for readout, _ in chosen} - set(BASELINES):
        raise InputError(
            "--bin has no effect on rnn|gru|cnn:K, where K is the number of frames per step; leave --bin out"
        )
    made = [_point(readout, number, options) for readout, number in chosen]
    made += [_recorded_point(folder, options) for folder in events or ()]
    _tell_idle(made, options["settings"])
    from eskin.snn.experiments.sweep import NEEDS
    from eskin.snn.experiments.sweep import sweep as run

    with (
        common.resumable(out),
        open_pool(workers, scheduler, NEEDS) as pool,
        _cell_bar(len(made) * folds * seeds) as show,
    ):
        found = run(made, out, pool=pool, folds=folds, seeds=seeds, command=command_line(), progress=show)
    _print_table(found)
    echo(f"result: {out / 'sweep.json'}")


def _tell_idle(points: list[SweepPoint], settings: list[str] | None) -> None:
    """Print the settings that affect only some points; raise an error for a setting without effect."""
    from eskin.snn.experiments.settings import idle_settings

    idle: dict[str, list[str]] = {}
    for point in points:
        for setting in idle_settings(point.experiment, settings)[1]:
            idle.setdefault(setting, []).append(point.name)
    for setting, names in idle.items():
        if len(names) == len(points):
            raise InputError(f"{setting} has no effect on any network of these points; leave it out")
        echo(f"note: {setting} has no effect on the network of {', '.join(names)}", file=sys.stderr)


def _point(readout: str, numbers: str, options: dict[str, Any]) -> SweepPoint:
    """Return the sweep point for a readout and the other options of the command."""
    from eskin.snn.experiments.sweep import SweepPoint

    options = options | UNSAID
    try:
        if readout in BASELINES:
            frames = FrameSteps(frames_per_step=int(numbers))
            options |= {"frames": frames.name, "bin_s": frames.step_s, "recipe": readout, "tau": None, "start": None}
        elif readout in get_args(FrameKind):
            options |= {"frames": f"{readout}:{numbers}", "tau": None, "start": None}
        else:
            bits, _, variant = numbers.partition(":")
            options |= {"encoding": readout, "resolution": int(bits), "variant": variant or None}
            options |= {"tau": options["tau"] if readout in LEAKY else None}
        made = build_experiment(options)
        if options["data"] is not None:
            made = made.with_readout_of_events()
        return SweepPoint(f"{readout}-{numbers}".replace(":", "-"), made)
    except InputError as error:
        raise InputError(f"point {readout}:{numbers}: {error}") from None


def _recorded_point(folder: Path, options: dict[str, Any]) -> SweepPoint:
    from eskin.snn.experiments.sweep import SweepPoint

    made = build_experiment(options | UNSAID | {"events": folder})
    whole = folder.resolve()
    return SweepPoint(whole.parent.name if whole.name == "events" else whole.name, made.with_readout_of_events())


def _print_table(points: list[Point]) -> None:
    print_table(
        "point | rate | last epoch | 95 % interval | sd | selected | sd",
        points,
        "{name} | {normalised_rate:.3g} | {last[accuracy]:100*.1f} | {last[bootstrap_95][0]:100*.1f} to "
        "{last[bootstrap_95][1]:100*.1f} | {last[sd_over_cells]:100*.1f} | {selected[accuracy]:100*.1f}"
        " | {selected[sd_over_cells]:100*.1f}",
        "accuracy in % by data rate in units of 640 kb/s\n"
        "95 % interval over images and seeds; sd over cells, each one fold and seed",
    )


@contextmanager
def _cell_bar(total: int) -> Iterator[Any]:
    """Yield the function ``progress`` of a sweep; without a terminal, print a line per finished training."""
    if not watched():

        def line(run: PointRun, result: dict[str, Any] | None) -> None:
            if result is not None:
                cell = f"fold {result['fold']}, seed {result['seed']}"
                print(f"{run.point.name}, {cell}: {_state(run)}", flush=True)

        yield line
        return
    done: dict[str, int] = {}
    with progress_of("cells", "{task.description}") as shown:
        task = shown.add_task("", total=total)

        def show(run: PointRun, result: dict[str, Any] | None) -> None:
            done[run.point.name] = len(run.done)
            words = f"{run.point.name}: {_state(run)}" if run.ready else f"recording the scans of {run.point.name}"
            shown.update(task, completed=sum(done.values()), description=words)

        yield show


def _state(run: PointRun) -> str:
    return f"{len(run.done)} of {len(run.cells)} trainings done, accuracy so far {run.accuracy:.1%}"
