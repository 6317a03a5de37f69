"""Arrange marks side by side, and place labels where they cover nothing.

All coordinates are points of the page (1/72 inch), so that the data are drawn unchanged. Call it when the layout is
final: the axes must not change their size afterwards.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Annotation

STEP_POINTS = 1.0  # unit of the shifts of marks


@dataclass(frozen=True)
class Box:
    """A rectangle on the page, in points."""

    left: float
    bottom: float
    right: float
    top: float

    def meets(self, other: Box) -> bool:
        """Return True if two boxes overlap."""
        across = self.left < other.right and other.left < self.right
        return across and self.bottom < other.top and other.bottom < self.top

    def within(self, other: Box) -> bool:
        """Return True if this box lies inside another box."""
        across = other.left <= self.left and self.right <= other.right
        return across and other.bottom <= self.bottom and self.top <= other.top

    def moved(self, right: float) -> Box:
        """Return the box shifted to the right."""
        return Box(self.left + right, self.bottom, self.right + right, self.top)


@dataclass
class Taken:
    """Occupied areas of a panel: marks, bars and thin lines."""

    boxes: list[Box] = field(default_factory=list)
    lines: list[Box] = field(default_factory=list)

    def add_line(self, ends: Sequence[tuple[float, float]]) -> None:
        """Add a line through several points, as small boxes along the line."""
        for (x0, y0), (x1, y1) in itertools.pairwise(ends):
            count = max(1, int(max(abs(x1 - x0), abs(y1 - y0)) / 4))
            for k in range(count + 1):
                x, y = x0 + (x1 - x0) * k / count, y0 + (y1 - y0) * k / count
                self.lines.append(Box(x - 1, y - 1, x + 1, y + 1))


def on_page(panel: Axes, x: float, y: float) -> tuple[float, float]:
    """Convert a point from data coordinates to page coordinates in points."""
    scale = 72 / panel.figure.dpi
    across, up = panel.transData.transform((x, y))
    return float(across * scale), float(up * scale)


def in_data(panel: Axes, x: float, y: float) -> tuple[float, float]:
    """Convert a point from page coordinates in points to data coordinates."""
    scale = panel.figure.dpi / 72
    across, up = panel.transData.inverted().transform((x * scale, y * scale))
    return float(across), float(up)


def side_by_side(boxes: Sequence[Box], taken: Iterable[Box]) -> float:
    """Return the smallest shift to either side that separates boxes from all occupied areas, else 0."""
    taken = list(taken)
    moves = [0.0] + [sign * STEP_POINTS * k for k in range(1, 31) for sign in (-1, 1)]
    free = (move for move in moves if not any(box.moved(move).meets(other) for box in boxes for other in taken))
    return next(free, 0.0)


def place_label(panel: Axes, label: Annotation, own: Box, taken: Taken, sides: str) -> None:
    """Move a label to the first free place beside its mark, inside the plot area.

    A place on thin lines alone is taken if there is no better one. The label then counts as taken. The label has its
    text in points from its mark (``textcoords="offset points"``); ``own`` is the mark with its bar. ``sides`` are some
    of "above", "below", "right" and "left", in the order of trial, separated by blanks.
    """
    scale = 72 / panel.figure.dpi
    size = label.get_window_extent()
    frame = Box(*(float(end * scale) for end in panel.get_window_extent().extents))
    places = _places(own, size.width * scale, size.height * scale, sides.split())
    free = [box for box in places if box.within(frame) and not any(box.meets(other) for other in taken.boxes)]
    if not free:
        label.set_visible(False)  # no room: the legend and the data still name the point
        return
    box = next((box for box in free if not any(box.meets(other) for other in taken.lines)), free[0])
    x, y = on_page(panel, *label.xy)
    label.set(ha="center", va="center")
    label.set_position(((box.left + box.right) / 2 - x, (box.bottom + box.top) / 2 - y))
    taken.boxes.append(box)


def _places(own: Box, width: float, height: float, sides: Sequence[str]) -> Iterator[Box]:
    """Yield the candidate positions of a label around its mark, nearest first."""
    middle_x, middle_y = (own.left + own.right) / 2, (own.bottom + own.top) / 2
    for gap in (3.0, 6.0, 10.0, 15.0, 20.0):
        for side in sides:
            for slide in (0.0, -0.3, 0.3, -0.6, 0.6):
                if side in ("above", "below"):
                    x = middle_x + slide * width
                    y = own.top + gap + height / 2 if side == "above" else own.bottom - gap - height / 2
                else:
                    x = own.right + gap + width / 2 if side == "right" else own.left - gap - width / 2
                    y = middle_y + slide * height
                yield Box(x - width / 2, y - height / 2, x + width / 2, y + height / 2)
