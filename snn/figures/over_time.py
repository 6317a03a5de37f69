"""Write and draw the classes of windows over time."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from eskin.base.figures.style import PALETTE, dress, new_figure, save_figure
from eskin.base.files import atomic_write

MAX_PANELS = 8
"""Files that are drawn; the table has all."""


Windows = Mapping[str, Sequence[tuple[Any, ...]]]
"""Cells of the windows by file, without the name of the file."""


def over_time(images: Sequence[Mapping[str, Any]]) -> Windows:
    """Return end in seconds, predicted class and class of every window, by file, in order of time.

    A network with a margin adds class and seconds of the early decision, from the start of the window on. ``images``
    are the predictions of ``evaluate.predictions``; names of windows end in ``@1.250s``.
    """
    found: dict[str, list[tuple[Any, ...]]] = {}
    for image in images:
        file, at, end = str(image["name"]).rpartition("@")
        if at and end.endswith("s"):
            row: tuple[Any, ...] = (float(end[:-1]), image["predicted"], image["class"] or "")
            if "early" in image:
                row += (image["early"] or "", "" if image["early"] is None else f"{image['early_s']:.3f}")
            found.setdefault(file, []).append(row)
    return {file: sorted(windows) for file, windows in found.items()}


def write_over_time(windows: Windows, out: Path) -> None:
    """Write a .csv with the end of each window, its predicted class, its class if known, and the early decision."""
    with io.StringIO(newline="") as text:
        table = csv.writer(text, lineterminator="\n")
        columns = ["file", "end_s", "predicted", "class", "early", "early_s"]
        table.writerow(columns[: 1 + len(next(iter(windows.values()))[0])])
        table.writerows([file, f"{end_s:.3f}", *kinds] for file, rows in windows.items() for end_s, *kinds in rows)
        content = text.getvalue()
    with atomic_write(out) as file:
        file.write(content.encode())


def plot_over_time(windows: Windows, classes: Sequence[str], out: Path) -> None:
    """Draw predicted classes as dots and known classes as a line, one panel a file."""
    shown = list(windows.items())[:MAX_PANELS]
    more = f" (first {len(shown)} of {len(windows)} files)" if len(shown) < len(windows) else ""
    figure = new_figure(8, 1.2 + 1.1 * len(shown), f"Classes over time{more}")
    panels = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
    for panel, (file, rows) in zip(panels, shown, strict=True):
        dress(panel, file, "end of the window (s)" if file == shown[-1][0] else "")
        ends = [end_s for end_s, *_ in rows]
        known = [(end_s, classes.index(kind)) for end_s, _, kind, *_ in rows if kind in classes]
        if known:
            panel.step(*zip(*known, strict=True), where="post", color=PALETTE["grey"], label="class")
        panel.plot(ends, [classes.index(kind) for _, kind, *_ in rows], ".", color=PALETTE["blue"], label="predicted")
        panel.set_yticks(range(len(classes)), classes)
        panel.set_ylim(-0.5, len(classes) - 0.5)
    panels[0].legend(frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1, 1))
    save_figure(figure, out)
