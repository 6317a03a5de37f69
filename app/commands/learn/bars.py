"""Show the progress of trainings: bars on a terminal, lines elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from eskin.base.progress import progress_of, watched

if TYPE_CHECKING:
    from eskin.snn.experiments.sweep import PointRun


@contextmanager
def epoch_bar(epochs: int) -> Iterator[tuple[Any, Any]]:
    """Yield two functions: the first reports an epoch, the second prints a sentence.

    Without a terminal, only every tenth epoch is printed.

    Sentences are warnings, and go to standard error always.
    """
    if not watched():

        def line(epoch: Any) -> None:
            if epoch.number % 10 == 0 or epoch.number == epochs:
                print(f"epoch {epoch.number}/{epochs}: loss {epoch.loss:.3f}, training accuracy {epoch.accuracy:.1%}")
                sys.stdout.flush()

        yield line, lambda text: print(f"warning: {text}", file=sys.stderr)
        return
    words = "loss {task.fields[loss]:.3f}, training accuracy {task.fields[accuracy]:.1%}"
    with progress_of("epochs", words, time_left=True) as shown:
        task = shown.add_task("", total=epochs, loss=float("nan"), accuracy=0.0)
        yield (
            lambda epoch: shown.update(task, completed=epoch.number, loss=epoch.loss, accuracy=epoch.accuracy),
            lambda text: shown.console.print(f"warning: {text}", markup=False),
        )


@contextmanager
def cell_bar(total: int) -> Iterator[Any]:
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
    return f"{len(run.done)} of {len(run.paths)} trainings done, accuracy so far {run.accuracy:.1%}"
