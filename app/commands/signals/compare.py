"""The command compare (docs/guide/files.md)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import typer

from eskin.app.options import arg, out_file
from eskin.app.tables import new_table, show
from eskin.base.figures.style import check_picture_path
from eskin.model.events.compare import count_per_taxel, covering_config, first_difference
from eskin.model.events.recording import Recording
from eskin.skin.figures.raster import plot_comparison

_MOST_LINES = 32  # differing taxels listed


def compare(
    a: Path = arg(..., "A", "event file"),
    b: Path = arg(..., "B", "event file"),
    plot: Path | None = out_file(None, "--plot", "FILE", "file for a raster plot of both recordings"),
) -> None:
    """Compare two event files; exit code 0 if all events are equal, 1 if not."""
    if plot is not None:
        check_picture_path(plot)
    first, second = Recording.load(a), Recording.load(b)
    labels = (a.name, b.name) if a.name != b.name else (str(a), str(b))
    for line in _settings_that_differ(first, second, labels):
        print(line)
    difference = first_difference(first.events, second.events)
    if plot is not None:
        duration = max(first.duration_clocks, second.duration_clocks)
        config = covering_config(first.config, second.config)
        plot_comparison((first.events, second.events), config, plot, labels, duration_clocks=duration)
    if difference is None:
        print(f"equal: {len(first.events)} events")
        return
    print(difference.describe(labels))
    _print_counts(first, second, labels)
    raise typer.Exit(1)


def _settings_that_differ(first: Recording, second: Recording, labels: tuple[str, str]) -> list[str]:
    fields = [
        recording.config.to_dict() | {"duration_clocks": recording.duration_clocks} for recording in (first, second)
    ]
    return [
        f"{name} differs: {labels[0]} {value}; {labels[1]} {fields[1][name]}"
        for name, value in fields[0].items()
        if value != fields[1][name]
    ]


def _print_counts(first: Recording, second: Recording, labels: tuple[str, str]) -> None:
    """Print the event counts of taxels with different counts in both files."""
    config = covering_config(first.config, second.config)
    counts = [count_per_taxel(recording.events, config) for recording in (first, second)]
    print(f"\n{labels[0]} has {len(first.events)} events, {labels[1]} {len(second.events)}")
    differing = np.argwhere(counts[0] != counts[1])
    if not len(differing):
        print("every taxel has equally many events in both files")
        return
    print(f"the number of events differs in {len(differing)} of {config.taxels} taxels")
    table = new_table(("row", "column", *labels, "difference"), left=(), overflow="fold")
    for row, column in differing[:_MOST_LINES]:
        n, m = (int(c[row, column]) for c in counts)
        table.add_row(str(row), str(column), str(n), str(m), f"{m - n:+d}")
    if len(differing) > _MOST_LINES:
        table.caption = f"and {len(differing) - _MOST_LINES} more"
    show(table)
