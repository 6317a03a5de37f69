"""Raster plots of address events: time on the x axis, taxels on the y axis, ON and OFF in colour-blind-safe colours."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.figures.style import GREY, OFF_COLOUR, ON_COLOUR, UNMATCHED_COLOUR, check_picture_path, save_figure
from eskin.model.address_events import Events, taxel_of
from eskin.model.config import ReadoutConfig
from eskin.model.events.compare import unmatched

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH_IN = 10.0
_TICK_LIMIT = 4000  # events drawn one by one; more become an image, which takes the same time for any number
_RING_LIMIT = 300  # marked events drawn as large rings; more become dots
_BINS = 1100  # columns of that image: a little wider than a pixel of the axes
_LINES = 12  # signals drawn at most
_POINTS = 4000  # points of a signal drawn at most


def plot_comparison(
    pair: tuple[Events, Events],
    config: ReadoutConfig,
    path: str | Path,
    labels: tuple[str, str] = ("RTL", "model"),
    title: str = "",
    signal: NDArray[np.floating[Any]] | None = None,
    texture: NDArray[Any] | None = None,
    duration_clocks: int | None = None,
) -> None:
    """Plot two recordings of one readout above each other, with black rings around events that differ.

    Raise InputError if the picture cannot be written.

    - ``pair``: shape (events,); the recordings; the first is drawn above the second.
    - ``config``: array size and clock.
    - ``path``: picture to write: .png, .pdf or .svg.
    - ``labels``: names of the recordings.
    - ``title``: line above everything.
    - ``signal``: shape (ticks, taxels); samples in full scale (+-1.0), drawn above the events; only some taxels of
      large arrays.
    - ``texture``: shape (height, width) or (height, width, 3); the scanned part of the image, drawn at the top: the
      array passes its width in the duration.
    - ``duration_clocks``: end of the time axis; by default the last event or the last sample.
    """
    check_picture_path(path)
    marks = unmatched(*pair)
    equal = not any(mark.any() for mark in marks)
    rasters = [
        (label, events, mark, "all events equal" if equal else f"{int(mark.sum()):,} without an equal")
        for label, events, mark in zip(labels, pair, marks, strict=True)
    ]
    signals = {} if signal is None else {"signal": signal}
    save_figure(_draw(config, rasters, signals, title, duration_clocks, texture), path)


def plot_signals(
    events: Events,
    signal: NDArray[np.floating[Any]] | None,
    config: ReadoutConfig,
    path: str | Path,
    title: str = "",
    label: str = "signal",
    duration_clocks: int | None = None,
) -> None:
    """Plot signals above their events and write the picture.

    - ``events``: shape (events,).
    - ``signal``: shape (ticks, taxels); signals in full scale; row k is the sample tick at clock ``k *
      clocks_per_sample``.
    - ``label``: name of the signals.
    - ``config``, ``path``, ``title``, ``duration_clocks``: same as for :func:`plot_comparison`.
    """
    check_picture_path(path)
    save_figure(draw_signals(events, {} if signal is None else {label: signal}, config, title, duration_clocks), path)


def draw_signals(
    events: Events,
    signals: Mapping[str, NDArray[np.floating[Any]]],
    config: ReadoutConfig,
    title: str = "",
    duration_clocks: int | None = None,
) -> Figure:
    """Return a figure with one panel per signal above a raster of the events.

    - ``signals``: shape (ticks, taxels); signals by panel name; same as for :func:`plot_signals`.
    - ``events``, ``config``, ``title``, ``duration_clocks``: same as for :func:`plot_signals`.
    """
    return _draw(config, [("events", events, np.zeros(len(events), np.bool_), "")], signals, title, duration_clocks)


def _draw(
    config: ReadoutConfig,
    rasters: Sequence[tuple[str, Events, NDArray[np.bool_], str]],
    signals: Mapping[str, NDArray[np.floating[Any]]],
    title: str,
    duration_clocks: int | None,
    texture: NDArray[Any] | None = None,
) -> Figure:
    """Return a figure with a common time axis: texture, signals, and rasters (label, events, marked events, remark)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    end_ms = _end_ms(config, [events for _, events, _, _ in rasters], signals.values(), duration_clocks)
    raster_in = min(max(1.0, 0.045 * config.taxels), 3.0)
    heights = [1.0] * (texture is not None) + [1.5] * len(signals) + [raster_in] * len(rasters)
    figure = Figure(figsize=(_WIDTH_IN, sum(heights) + 0.45 * len(heights) + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    for panel in panels:
        panel.spines[["top", "right"]].set_visible(False)
        panel.tick_params(labelsize=8, length=3)
    if title:
        figure.suptitle(title, x=0.01, ha="left", fontsize=11, fontweight="bold")
    below = iter(panels)
    if texture is not None:
        _draw_texture(next(below), texture, end_ms)
    for label, signal in signals.items():
        _draw_signals(next(below), signal, config, label)
    for label, events, mark, remark in rasters:
        panel = next(below)
        _draw_events(panel, events, config, end_ms, mark)
        _caption(panel, label, f"{len(events):,} events" + (f", {remark}" if remark else ""))
    _legend(panels[-len(rasters)], config, any(mark.any() for _, _, mark, _ in rasters))
    panels[-1].set_xlim(0, end_ms)
    panels[-1].set_xlabel("time (ms)", fontsize=8.5)
    return figure


def _end_ms(
    config: ReadoutConfig, recordings: Iterable[Events], signals: Iterable[NDArray[Any]], duration_clocks: int | None
) -> float:
    if duration_clocks is None:
        ends = [int(events["t"][-1]) + 1 for events in recordings if len(events)]
        ends += [len(signal) * config.clocks_per_sample for signal in signals]
        duration_clocks = max(ends, default=config.clocks_per_sample)
    return max(duration_clocks, 1) * 1e3 / config.clock_hz


def _caption(panel: Axes, label: str, remark: str = "") -> None:
    panel.set_title(label, loc="left", fontsize=9.5, fontweight="bold", pad=4)
    panel.set_title(remark, loc="center", fontsize=8.5, color=GREY, pad=4)


def _draw_texture(panel: Axes, texture: NDArray[Any], end_ms: float) -> None:
    """Draw the scanned image above the time axis."""
    panel.imshow(texture, cmap="gray", aspect="auto", extent=(0, end_ms, 0, 1), interpolation="antialiased")
    panel.set_yticks([])
    panel.spines[:].set_visible(False)
    _caption(panel, "texture")


def _draw_signals(panel: Axes, signal: NDArray[Any], config: ReadoutConfig, label: str) -> None:
    """Draw the samples of evenly spaced taxels."""
    from matplotlib import colormaps

    ticks, taxels = signal.shape
    chosen = np.unique(np.linspace(0, taxels - 1, min(taxels, _LINES)).round().astype(int))
    stride = max(1, -(-ticks // _POINTS))
    time_ms = np.arange(0, ticks, stride) * 1e3 / config.sample_rate_hz
    colours = colormaps["cividis"](np.linspace(0.05, 0.8, len(chosen)))
    for taxel, colour in zip(chosen, colours, strict=True):
        panel.plot(time_ms, signal[::stride, taxel], color=colour, lw=0.7, alpha=0.85, rasterized=True)
    panel.set_ylabel("full scale", fontsize=8)
    panel.margins(y=0.08)
    shown = f"{len(chosen)} of {taxels} taxels, " if len(chosen) < taxels else ""
    first, last = chosen[0], chosen[-1]
    _caption(panel, label, f"{shown}taxel {first} dark to taxel {last} light" if taxels > 1 else "")


def _draw_events(panel: Axes, events: Events, config: ReadoutConfig, end_ms: float, mark: NDArray[np.bool_]) -> None:
    """Draw events as short vertical ticks, one row per taxel, with taxel 0 at the top."""
    time_ms = events["t"] * (1e3 / config.clock_hz)
    taxel = taxel_of(events, config)
    if len(events) <= _TICK_LIMIT:
        for which, colour in ((events["p"], ON_COLOUR), (~events["p"], OFF_COLOUR)):
            low, high = taxel[which] - 0.4, taxel[which] + 0.4
            panel.vlines(time_ms[which], low, high, colors=colour, lw=0.9, rasterized=True)
    else:
        _draw_density(panel, time_ms, taxel, events["p"], config, end_ms)
    few = mark.sum() <= _RING_LIMIT
    style: dict[str, Any] = (
        {"s": 45, "facecolors": "none", "edgecolors": UNMATCHED_COLOUR, "linewidths": 1.1}
        if few
        else {"s": 1.5, "color": UNMATCHED_COLOUR, "linewidths": 0}
    )
    panel.scatter(time_ms[mark], taxel[mark], zorder=4, rasterized=True, clip_on=False, **style)
    if 1 < config.columns < config.taxels and config.rows <= 32:
        for row in range(1, config.rows):
            panel.axhline(row * config.columns - 0.5, color="#dddddd", lw=0.5, zorder=0)
    every = -(-config.rows // 8)
    panel.set_yticks(np.arange(0, config.rows, every) * config.columns)
    panel.set_ylim(config.taxels - 0.5, -0.5)
    panel.set_ylabel("taxel", fontsize=8)


def _draw_density(
    panel: Axes,
    time_ms: NDArray[np.floating[Any]],
    taxel: NDArray[np.int64],
    on: NDArray[np.bool_],
    config: ReadoutConfig,
    end_ms: float,
) -> None:
    """Draw event density as an image: hue shows the share of ON events, opacity the event count."""
    from matplotlib.colors import to_rgb

    column = np.minimum((time_ms * (_BINS / end_ms)).astype(np.int64), _BINS - 1)
    inside = column >= 0
    cell = taxel * _BINS + column
    shape = (config.taxels, _BINS)
    size = config.taxels * _BINS
    total = np.bincount(cell[inside], minlength=size)[:size].reshape(shape)
    share = np.bincount(cell[inside & on], minlength=size)[:size].reshape(shape) / np.maximum(total, 1)
    picture = np.empty((*shape, 4))
    picture[..., :3] = share[..., None] * to_rgb(ON_COLOUR) + (1 - share[..., None]) * to_rgb(OFF_COLOUR)
    typical = max(1.0, float(np.percentile(total[total > 0], 90)))
    picture[..., 3] = np.where(total, np.clip(0.35 + 0.65 * total / typical, 0, 1), 0)
    if config.taxels <= 128:  # a gap between taxels, where there is room for one
        picture = np.repeat(picture, 5, axis=0)
        picture[4::5, :, 3] = 0
    extent = (0, end_ms, config.taxels - 0.5, -0.5)
    panel.imshow(picture, aspect="auto", extent=extent, interpolation="antialiased", zorder=2)


def _legend(panel: Axes, config: ReadoutConfig, any_marked: bool) -> None:
    from matplotlib.lines import Line2D

    def key(colour: str, label: str, marker: str = "|") -> Line2D:
        face = "none" if marker == "o" else colour
        return Line2D([], [], color=colour, marker=marker, ls="", ms=7, mfc=face, mew=1.6, label=label)

    keys = [key(ON_COLOUR, "ON"), key(OFF_COLOUR, "OFF")] if config.has_polarity else [key(ON_COLOUR, "event")]
    if any_marked:
        keys.append(key(UNMATCHED_COLOUR, "no equal", "o"))
    panel.legend(
        handles=keys,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=len(keys),
        frameon=False,
        fontsize=8.5,
        handletextpad=0.1,
        columnspacing=1.0,
        borderaxespad=0.1,
    )
