"""Labels and styles of trained networks in figures."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from eskin.base.figures.style import PALETTE
from eskin.model.encoders import registry
from eskin.skin.figures.readouts import FRAME, look

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = tuple(PALETTE[name] for name in ("blue", "sky", "grey", "black"))
"""Colours of networks with unknown readout, in turn."""
MARKERS = "osD^vP"
LINES = ("-", "--", ":", "-.")
"""Lines of the networks of one readout, in turn."""

ENCODERS = "|".join(sorted(registry.NAMES, key=len, reverse=True))
RECIPES = {"paper": "the paper's network", "hardware": "leaky network"}
"""Recipes of the project's trainings in words."""
TRAINED = {"clean": "trained on undisturbed scans", "robust": "trained on disturbed scans"}
FRAMES = {"onoff": "ON/OFF of differences", "diff": "differences"}


def label(name: str) -> str:
    """Return the label of a readout or network; names given by a user stay unchanged.

    Examples
    --------
    >>> label("cw-lcs-4"), label("lcs:3"), label("frame:500:6"), label("frame-onoff"), label("mine")
    ('CW-LCS 4 b', 'LCS 3 b', 'frames, 500 Hz, 6 b', 'frames, ON/OFF of differences', 'mine')
    """
    if parts := re.fullmatch(rf"({ENCODERS})[-:](\d+)", name):
        return f"{look(parts[1]).title} {parts[2]} b"
    if parts := re.fullmatch(r"frame:([\d.]+):(\d+)", name):
        return f"frames, {parts[1]} Hz, {parts[2]} b"
    if (parts := re.fullmatch(r"frame-(\w+)", name)) and parts[1] in FRAMES:
        return f"frames, {FRAMES[parts[1]]}"
    return TRAINED.get(name, name)


def family(name: str) -> tuple[str, str]:
    """Return the panel of a network and its label in that panel.

    Examples
    --------
    >>> family("hardware-paper-64-qat4")
    ('leaky network, paper scan', '64 neurons, trained with weights of 4 b')
    >>> family("mine-32")
    ('mine', '32 neurons')
    """
    parts = re.fullmatch(r"(.+?)-(\d+)(?:-qat(\d))?", name)
    if parts is None:
        return "networks", name
    own = re.fullmatch(rf"({'|'.join(RECIPES)})-(paper|physical)", parts[1])
    words = parts[1] if own is None else f"{RECIPES[own[1]]}, {own[2]} scan"
    return words, f"{parts[2]} neurons" + (f", trained with weights of {parts[3]} b" if parts[3] else "")


def readout_of(name: str) -> str | None:
    """Return the readout with which the name of a network begins, or None."""
    parts = re.match(rf"({ENCODERS}|{FRAME})[-:]", name)
    return parts[1] if parts else None


def network_styles(points: Iterable[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return colour, marker and line style by network name."""
    readouts = {point["network"]: point.get("readout") or readout_of(point["network"]) for point in points}
    styles: dict[str, dict[str, Any]] = {}
    for number, (network, readout) in enumerate(readouts.items()):
        if readout is None:
            style = COLOURS[number % len(COLOURS)], MARKERS[number % len(MARKERS)], LINES[number % len(LINES)]
        else:
            before = [readouts[name] for name in styles].count(readout)
            style = look(readout).colour, look(readout).marker, LINES[before % len(LINES)]
        styles[network] = dict(zip(("color", "marker", "linestyle"), style, strict=True))
    return styles


def draw_accuracies(
    axis: Axes, x: Sequence[float], points: Sequence[Mapping[str, Any]], style: Mapping[str, Any], **line: Any
) -> None:
    """Draw a line through the accuracies of points, with pale error bars."""
    middle = [100 * point["accuracy"] for point in points]
    ends = [[100 * abs(point["accuracy"] - point["bootstrap_95"][end]) for point in points] for end in (0, 1)]
    axis.errorbar(x, middle, ends, color=style["color"], alpha=0.25, linestyle="none", capsize=2)
    axis.plot(x, middle, **style, **line)


def draw_networks(
    axis: Axes,
    points: Sequence[Mapping[str, Any]],
    x: Callable[[Mapping[str, Any]], float],
    styles: Mapping[str, Mapping[str, Any]],
) -> None:
    """Draw the accuracies of every network; ``x`` returns the place of a point."""
    for network, style in styles.items():
        own = [point for point in points if point["network"] == network]
        draw_accuracies(axis, [x(point) for point in own], own, style, markersize=4, label=label(network))
