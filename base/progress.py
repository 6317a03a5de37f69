"""Report the progress of commands: bars on a terminal, lines elsewhere."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.progress import Progress


SILENCE_S = 15.0  # time between two lines about long steps where no terminal shows a bar


def watched() -> bool:
    """Return True if standard error is a terminal."""
    return sys.stderr.isatty()


def processor_s() -> float:
    """Return the processor seconds of this process, and of its child processes that have ended."""
    return sum(os.times()[:4])


def note(text: str) -> None:
    """Print a line about the progress of a command."""
    print(text, file=sys.stderr, flush=True)


def progress_of(*words: str, spinner: bool = False, time_left: bool = False, transient: bool = True) -> Progress:
    """Return a progress display in the common style.

    The display shows the first text, a bar, a count, the time (passed or left), and the other texts.

    A spinner is a turning mark at the beginning. Transient bars disappear at the end.
    """
    from rich import progress
    from rich.console import Console

    columns: list[Any] = [progress.SpinnerColumn()] if spinner else []
    columns += [progress.TextColumn(words[0]), progress.BarColumn(), progress.MofNCompleteColumn()]
    columns += [progress.TimeRemainingColumn() if time_left else progress.TimeElapsedColumn()]
    columns += map(progress.TextColumn, words[1:])
    return progress.Progress(*columns, console=Console(stderr=True), transient=transient)


@contextmanager
def bar(text: str, total: int | None = None) -> Iterator[Callable[[], None]]:
    """Yield a function that advances a progress bar by 1."""
    with bars(spinner=False, transient=True) as show:
        yield show(text, total)[0]


@contextmanager
def bars(
    spinner: bool = True, transient: bool = False
) -> Iterator[Callable[[str, int | None], tuple[Callable[[], None], Callable[[str], None]]]]:
    """Yield a function that adds a progress bar and returns functions to advance and rename the bar.

    Without a terminal, print a line about every unfinished bar every ``SILENCE_S``.
    """
    if not watched():
        with _lines() as tasks:
            yield lambda text, total: _added(tasks, _Task(text, total))
        return
    with progress_of("{task.description}", spinner=spinner, transient=transient) as shown:

        def add(text: str, total: int | None) -> tuple[Callable[[], None], Callable[[str], None]]:
            task = shown.add_task(text, total=total)
            return lambda: shown.advance(task), lambda words: shown.update(task, description=words)

        yield add


@contextmanager
def reported(text: str) -> Iterator[None]:
    """Report a long step; without a terminal, print the elapsed seconds every ``SILENCE_S``."""
    if watched():
        yield
        return
    with _lines() as tasks:
        tasks.append(_Task(text, 0))
        yield


@dataclass
class _Task:
    """A step that takes long."""

    text: str
    total: int | None  # 0: without a count
    done: int = 0

    @property
    def line(self) -> str:
        """What is done so far."""
        if self.total == 0:
            return f"{self.text}:"
        return f"{self.text}: {self.done}{'' if self.total is None else f' of {self.total}'},"

    def advance(self) -> None:
        """Count one more."""
        self.done += 1

    def rename(self, words: str) -> None:
        """Change the text."""
        self.text = words


def _added(tasks: list[_Task], task: _Task) -> tuple[Callable[[], None], Callable[[str], None]]:
    tasks.append(task)
    return task.advance, task.rename


@contextmanager
def _lines() -> Iterator[list[_Task]]:
    """Yield a list of tasks; print a line about each unfinished one every ``SILENCE_S``."""
    tasks, done, started = list[_Task](), threading.Event(), time.monotonic()

    def report() -> None:
        while not done.wait(SILENCE_S):
            for task in tasks:
                if not task.total or task.done < task.total:
                    note(f"{task.line} {time.monotonic() - started:.0f} s so far")

    thread = threading.Thread(target=report, daemon=True)
    thread.start()
    try:
        yield tasks
    finally:
        done.set()
        thread.join()
