"""Cut recordings with a label for each sample into windows with a class (specification, section 18)."""

import dataclasses
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.skin.recordings.options import Preparation
from eskin.skin.recordings.table import Table

MAX_BLOCKS, WINDOWS_PER_BLOCK = 12, 2
"""Parts in time of a single file, in place of files, so that no test window overlaps a training window."""


@dataclass(frozen=True)
class Part:
    """Ticks of a recording with one class."""

    begin: int
    end: int  # not included
    label: str | None  # None: the file has no labels
    group: str  # parts of a group are never in different folds
    name: str  # within the file


@dataclass
class LeftOut:
    """Numbers of windows without a class, by reason."""

    missing: int = 0  # a sample has no label
    change: int = 0  # the label changes in the guard time
    border: int = 0  # the window crosses the border between two parts in time of a single file

    def notes(self, kept: int) -> tuple[str, ...]:
        """Return a sentence for the user."""
        reasons = {
            "a sample has no label": self.missing,
            "the label changes in the guard time (--guard)": self.change,
            "two trials, groups or parts in time meet in the window": self.border,
        }
        said = [f"{count} where {reason}" for reason, count in reasons.items() if count]
        return (f"{kept} windows with a class{'; left out: ' + ', '.join(said) if said else ''}",)


def parts_of(
    tables: Sequence[Table], ticks: Sequence[int], rate_hz: float, options: Preparation
) -> tuple[list[list[Part]], tuple[str, ...]]:
    """Return the parts of each recording that become recordings of their own, and notes.

    With a window, they are windows every hop; else each run of samples with equal label, group, trial and the like.

    - ``tables``: recordings; without labels, parts have no class.
    - ``ticks``, ``rate_hz``: ticks of each recording after resampling, and their rate.

    Raise InputError if no part is left.
    """
    window, hop, guard = (round(seconds * rate_hz) for seconds in (options.window_s, options.hop_s, options.guard_s))
    if options.window_s and not window:
        raise InputError(f"--window {options.window_s:g} is shorter than a sample; give at least {1 / rate_hz:.3g} s")
    alone = len(tables) == 1 and tables[0].groups is None and tables[0].labels is not None
    left_out = LeftOut()
    found = []
    for table, count in zip(tables, ticks, strict=True):
        labels, groups, runs = (
            _at_ticks(table, column, count, rate_hz) for column in (table.labels, table.groups, table.runs)
        )
        if window:
            blocks = np.arange(count) * _blocks(count, window) // count if alone else np.zeros(count, np.int64)
            made = _windows(labels, groups, runs, blocks, (window, max(hop, 1), guard), options.label_of, left_out)
        else:
            made = _runs(labels, groups, runs)
        found.append([dataclasses.replace(part, name=_named(part, rate_hz, window)) for part in made])
    kept = sum(map(len, found))
    if not kept:
        raise InputError(
            f"no window of {options.window_s:g} s has a class; give a shorter --window or --guard"
            if window
            else "no sample has a label; choose another --label-column"
        )
    if not window:
        return found, (f"{kept} runs of samples with one label; --window SECONDS cuts windows of equal length",)
    shared = "a file" if tables[0].groups is None else f"a value of {options.group_column}"
    grouped = "a part in time of the file" if alone else shared
    return found, (*left_out.notes(kept), f"a test window and a training window never share {grouped}")


def _blocks(ticks: int, window: int) -> int:
    return min(max(ticks // (WINDOWS_PER_BLOCK * window), 2), MAX_BLOCKS)


def _at_ticks(table: Table, column: NDArray[Any] | None, ticks: int, rate_hz: float) -> NDArray[Any] | None:
    """Return the cell of the newest sample at every tick of a resampled recording."""
    if column is None:
        return None
    if table.time_s is None or len(column) == ticks:
        return column[:ticks]
    at = np.searchsorted(table.time_s, np.arange(ticks) / rate_hz + 1e-9, side="right") - 1
    return column[np.clip(at, 0, len(column) - 1)]


def _windows(
    labels: NDArray[Any] | None,
    groups: NDArray[Any] | None,
    runs: NDArray[Any] | None,
    blocks: NDArray[np.int64],
    sizes: tuple[int, int, int],
    label_of: str,
    left_out: LeftOut,
) -> Iterator[Part]:
    """Yield the windows of a recording that have a class; ``sizes`` are the ticks of window, hop and guard."""
    window, hop, guard = sizes
    borders = [column for column in (groups, runs, blocks) if column is not None]
    for end in range(window, len(blocks) + 1, hop):
        begin = end - window
        if any((column[begin:end] != column[begin]).any() for column in borders):
            left_out.border += 1
            continue
        label = None
        if labels is not None:
            inside = labels[begin:end]
            near = labels[max(end - 1 - guard, 0) : end + guard]
            if (inside == "").any():
                left_out.missing += 1
                continue
            if guard and (near != near[0]).any():
                left_out.change += 1
                continue
            label = str(inside[-1]) if label_of == "last" else _most_frequent(inside)
        group = str(groups[begin]) if groups is not None else f"part {blocks[begin]}" if blocks.any() else ""
        yield Part(begin, end, label, group, "")


def _runs(labels: NDArray[Any] | None, groups: NDArray[Any] | None, runs: NDArray[Any] | None) -> Iterator[Part]:
    columns = [column for column in (labels, groups, runs) if column is not None]
    changes = np.any([column[1:] != column[:-1] for column in columns], axis=0)
    borders = [0, *(np.flatnonzero(changes) + 1).tolist(), len(columns[0])]
    for begin, end in itertools.pairwise(borders):
        label = None if labels is None else str(labels[begin])
        if label == "":
            continue
        yield Part(begin, end, label, "" if groups is None else str(groups[begin]), "")


def _most_frequent(labels: NDArray[Any]) -> str:
    names, counts = np.unique(labels, return_counts=True)
    return str(names[counts.argmax()])


def _named(part: Part, rate_hz: float, window: int) -> str:
    """Return the name of a part: the time of its end in seconds, or its first tick."""
    return f"{part.end / rate_hz:.3f}s" if window else f"{part.begin:06d}"
