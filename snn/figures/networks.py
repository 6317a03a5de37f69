"""Choose the style of trained networks in figures by their readout, if the points name it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from eskin.base.figures.style import PALETTE
from eskin.skin.figures.readouts import look

COLOURS = tuple(PALETTE[name] for name in ("blue", "vermilion", "green", "orange", "purple", "black"))
"""Colours of networks whose readout is not known, in turn."""
MARKERS = "osD^vP"
LINES = ("-", "--", ":", "-.")
"""Lines of the networks of one readout, in turn."""


def network_styles(points: Iterable[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return colour, marker and line by network name, in the order of the points."""
    readouts = {point["network"]: point.get("readout") for point in points}
    styles: dict[str, dict[str, Any]] = {}
    for number, (network, readout) in enumerate(readouts.items()):
        if readout is None:
            style = COLOURS[number % len(COLOURS)], MARKERS[number % len(MARKERS)], LINES[0]
        else:
            before = [readouts[name] for name in styles].count(readout)
            style = look(readout).colour, look(readout).marker, LINES[before % len(LINES)]
        styles[network] = dict(zip(("color", "marker", "linestyle"), style, strict=True))
    return styles
