"""Fig. 8: one scan from the texture through the network to the evidence of each class."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.figures.style import GREY, OFF_COLOUR, ON_COLOUR, PALETTE, dress, new_figure, save_figure
from eskin.model.address_events import taxel_of
from eskin.model.events.recording import Recording
from eskin.skin.textures.physical import PhysicalScan
from eskin.skin.textures.scan import Scan

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CLASS_COLOURS = tuple(
    PALETTE[name] for name in ("blue", "vermilion", "green", "purple", "orange", "sky", "black", "grey")
)
"""Colours of the classes; further classes repeat the colours."""

_INK = "#333333"
_WAY, _ARRAY = PALETTE["vermilion"], PALETTE["blue"]  # not among the greys of a texture
_SHOWN = 3  # taxels whose signal is drawn
_NOTE = 0.15  # this part of a panel's width has room for words


@dataclass(frozen=True, eq=False)
class ScanToClass:
    """Data of the figure: one scan, with the network's spikes and evidence."""

    name: str  # of the texture or recording
    true: str  # its class
    label: int  # class, an index into ``class_names``
    tested: bool  # True if the recording was not used in the training
    scan: Scan | None  # None for recordings
    pixels: NDArray[np.uint8] | None  # the texture, shape (height, width), or None
    recording: Recording  # events of the scan
    signals: NDArray[np.float64]  # samples in full scales, shape (ticks, taxels)
    start_s: float  # begin of the first time step
    step_s: float  # length of a step
    spikes: NDArray[np.float32]  # spikes of the hidden neurons, 0 or 1, shape (steps, hidden)
    evidence: NDArray[np.float32]  # sum of output spikes or membranes so far (see ``meaning``), shape (steps, classes)
    class_names: tuple[str, ...]
    meaning: str  # of the evidence, in words
    right: int = 0  # number of correct test images; 0 if unknown
    tests: int = 0  # number of test images; 0 if unknown
    numbers: Mapping[str, str] = field(default_factory=dict)
    """Additional text above the panels ``signals``, ``events``, ``hidden`` and ``evidence``."""

    @property
    def predicted(self) -> str:
        """Class with the largest final evidence."""
        return self.class_names[int(self.evidence[-1].argmax())]

    @property
    def ends_ms(self) -> NDArray[np.floating[Any]]:
        """End of every time step in milliseconds."""
        return 1e3 * (self.start_s + self.step_s * np.arange(1, len(self.spikes) + 1))

    def to_dict(self) -> dict[str, Any]:
        """Return the network output as a dictionary, with hidden spikes as pairs (step, neuron)."""
        return {
            "image": self.name,
            "of_the_test_fold": self.tested,
            "preset": None if self.scan is None else self.scan.name,
            "readout": self.recording.config.to_dict(),
            "events": len(self.recording.events),
            "start_s": self.start_s,
            "step_s": self.step_s,
            "class_names": list(self.class_names),
            "true": self.true,
            "predicted": self.predicted,
            "test_images_right": [self.right, self.tests],
            "evidence": self.evidence.tolist(),
            "hidden_spikes": np.argwhere(self.spikes).tolist(),
        }


def plot_scan(played: ScanToClass, path: Path) -> None:
    """Plot a scan and the response of the network; see :func:`draw_scan`."""
    save_figure(draw_scan(played), path)


def draw_scan(played: ScanToClass) -> Figure:
    """Return a figure of texture, taxel signals, events, hidden spikes and evidence."""
    true, predicted = played.true, played.predicted
    verdict = "right" if true == predicted else "wrong"
    noun = "recording" if played.pixels is None else "image"
    learned = f"test {noun}" if played.tested else f"training {noun}"
    title = f"{played.name} ({learned}): true {true}, predicted {predicted}, {verdict}"
    if played.tests:
        title += f"; {played.right} of {played.tests} test {noun}s are right"
    figure = new_figure(12, 8.4, title)
    grid = figure.add_gridspec(4, 2, width_ratios=(1, 2.9), height_ratios=(1.5, 1.3, 1.5, 1.4))
    draw_source = _draw_array if played.pixels is None else _draw_texture
    draw_source(figure.add_subplot(grid[:2, 0]), played)
    _draw_zoom(figure.add_subplot(grid[2, 0]), played)
    _draw_final(figure.add_subplot(grid[3, 0]), played)
    panels = [figure.add_subplot(grid[0, 1])]
    panels += [figure.add_subplot(grid[row, 1], sharex=panels[0]) for row in (1, 2, 3)]
    for panel, draw in zip(panels, (_draw_signals, _draw_events, _draw_hidden, _draw_evidence), strict=True):
        draw(panel, played)
        panel.grid(visible=False)
    for panel in panels[:-1]:
        panel.tick_params(labelbottom=False)
    panels[0].set_xlim(0, 1e3 * played.recording.duration_s)
    panels[-1].set_xlabel("time (ms)", fontsize=8.5)
    return figure


def _draw_texture(panel: Axes, played: ScanToClass) -> None:
    """Draw the image, the start position of the array, and the path of the scan."""
    from matplotlib.patches import Rectangle

    config, scan = played.recording.config, played.scan
    pixels = played.pixels
    assert pixels is not None
    assert scan is not None
    height, width = pixels.shape
    pitch = scan.taxel_pitch_px if isinstance(scan, PhysicalScan) else 1.0
    across, down = ((n - 1) * pitch + 1 for n in (config.columns, config.rows))
    rightwards = isinstance(scan, PhysicalScan) or width > height  # the paper's scan follows the longer side
    if rightwards and not isinstance(scan, PhysicalScan):
        across, down = down, across
    dress(panel, "texture and scan")
    panel.grid(visible=False)
    panel.imshow(pixels, cmap="gray", vmin=0, vmax=255)
    from matplotlib.patheffects import withStroke

    way = (width, down) if rightwards else (across, height)
    halo = [withStroke(linewidth=4.5, foreground="white")]
    panel.add_patch(Rectangle((-0.5, -0.5), *way, fill=False, ec=_WAY, lw=2, path_effects=halo))
    panel.add_patch(Rectangle((-0.5, -0.5), across, down, fill=False, ec=_ARRAY, lw=2.5, path_effects=halo))
    beside = 0.05 * min(width, height)  # the array may be thinner than a line of the picture
    long, far = (width, down + beside) if rightwards else (height, across + beside)
    ends = ((0.02 * long, far), (0.97 * long, far))
    start, end = ends if rightwards else tuple((y, x) for x, y in ends)
    panel.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": _WAY, "lw": 2.5, "path_effects": halo})
    place, offset = ((width / 2, far), (0, -6)) if rightwards else ((far, height / 2), (6, 0))
    panel.annotate("path of the array", place, xytext=offset, textcoords="offset points", color=_WAY, fontsize=8.5,
                   fontweight="bold", path_effects=halo, rotation=0 if rightwards else 90,
                   ha="center" if rightwards else "left", va="top" if rightwards else "center")  # fmt: skip
    panel.set_xlabel(f"pixels; array of {config.rows} x {config.columns} taxels, {scan.name} scan", fontsize=8.5)


def _draw_array(panel: Axes, played: ScanToClass) -> None:
    """Draw the signal range of each taxel of a recording."""
    config = played.recording.config
    moved = np.ptp(played.signals, axis=0).reshape(config.rows, config.columns)
    dress(panel, "movement of each taxel", f"column; {config.rows} x {config.columns} taxels", "row")
    panel.grid(visible=False)
    image = panel.imshow(moved, cmap="viridis", vmin=0)
    panel.figure.colorbar(image, ax=panel, shrink=0.7, label="full scales")
    panel.set_xticks(range(config.columns))
    panel.set_yticks(range(config.rows))


def _draw_signals(panel: Axes, played: ScanToClass) -> None:
    """Draw the samples of three taxels above each other, with their events."""
    shown = _shown(played)
    gap = 1.15 * max(float(np.ptp(played.signals[:, shown], axis=0).max()), 1e-6)
    for lane, taxel in enumerate(shown):
        _draw_taxel(panel, played, int(taxel), -lane * gap, 2.5, slice(None))
    panel.axvspan(*(1e3 * s for s in _zoom(played)), color="#e5e5e5", zorder=0)
    panel.set_yticks([-lane * gap for lane in range(len(shown))], [f"taxel {taxel}" for taxel in shown])
    handles, labels = panel.get_legend_handles_labels()
    kinds = len(set(labels))
    panel.legend(handles[:kinds], labels[:kinds], loc="lower right", bbox_to_anchor=(1, 1), ncols=2, frameon=False,
                 fontsize=8, handletextpad=0.1, markerscale=2.5, borderaxespad=0.1)  # fmt: skip
    _above(panel, played, "signals", "pressure signals and their events", f"lanes {gap:.2g} full scales apart")


def _draw_zoom(panel: Axes, played: ScanToClass) -> None:
    """Draw a few milliseconds of one taxel with its events."""
    config = played.recording.config
    first, last = (round(s * config.sample_rate_hz) for s in _zoom(played))
    shown = _shown(played)
    taxel = int(shown[len(shown) // 2])
    _draw_taxel(panel, played, taxel, 0.0, 5.0, slice(first, max(last, first + 2)))
    dress(panel, f"taxel {taxel}, the grey part", "time (ms)", "full scales")
    panel.grid(visible=False)


def _shown(played: ScanToClass) -> NDArray[np.int64]:
    """Return the numbers of the taxels in the figure: the first, the middle and the last taxel."""
    return np.unique(np.linspace(0, played.recording.config.taxels - 1, _SHOWN).astype(np.int64))


def _zoom(played: ScanToClass) -> tuple[float, float]:
    """Return the start and end of the detail: 20 ms of a scan, or the largest change of a recording."""
    duration_s, rate_hz = played.recording.duration_s, played.recording.config.sample_rate_hz
    start_s, length_s = duration_s / 4, 0.02
    if played.scan is None:
        shown = _shown(played)
        moves = np.abs(np.diff(played.signals[:, shown[len(shown) // 2]], prepend=0.0))
        length_s = max(length_s, 24 / rate_hz)
        start_s = max(0.0, min(moves.argmax() / rate_hz, duration_s) - length_s / 2)
    return start_s, min(start_s + length_s, duration_s)


def _draw_taxel(panel: Axes, played: ScanToClass, taxel: int, offset: float, size: float, ticks: slice) -> None:
    """Draw the signal of a taxel with its events, shifted vertically by an offset."""
    config, events = played.recording.config, played.recording.events
    signal = played.signals[:, taxel] + offset
    number = np.arange(len(signal))[ticks]
    panel.plot(1e3 * number / config.sample_rate_hz, signal[ticks], color=_INK, lw=0.7)
    index = taxel_of(events, config)
    for on, marker, colour in ((True, "^", ON_COLOUR), (False, "v", OFF_COLOUR)):
        clocks = events["t"][(index == taxel) & (events["p"] == on)]
        at = np.minimum(clocks // config.clocks_per_sample, len(signal) - 1)
        inside = (at >= number[0]) & (at <= number[-1])
        if on or config.has_polarity:
            label = ("ON" if on else "OFF") if config.has_polarity else "event"
            panel.plot(1e3 * clocks[inside] / config.clock_hz, signal[at[inside]], marker, color=colour, ms=size,
                       mew=0, label=label)  # fmt: skip


def _draw_events(panel: Axes, played: ScanToClass) -> None:
    config, events = played.recording.config, played.recording.events
    index = taxel_of(events, config)
    for on, colour in ((True, ON_COLOUR), (False, OFF_COLOUR)):
        chosen = events["p"] == on
        panel.plot(1e3 * events["t"][chosen] / config.clock_hz, index[chosen], ls="", marker="|", ms=2, mew=0.6,
                   color=colour, alpha=0.8, rasterized=True)  # fmt: skip
    panel.set_ylim(config.taxels - 0.5, -0.5)
    panel.set_ylabel("taxel", fontsize=8.5)
    _above(panel, played, "events", "address events", f"{len(events):,} events of {config.taxels} taxels")


def _draw_hidden(panel: Axes, played: ScanToClass) -> None:
    step, neuron = np.nonzero(played.spikes)
    panel.plot(played.ends_ms[step], neuron, ls="", marker="|", ms=2, mew=0.7, color=_INK, rasterized=True)
    panel.set_ylim(played.spikes.shape[1] - 0.5, -0.5)
    panel.set_ylabel("neuron", fontsize=8.5)
    if played.start_s > 0:
        panel.axvspan(0, 1e3 * played.start_s, color="#eeeeee", zorder=0)
        if played.start_s >= _NOTE * played.recording.duration_s:
            panel.text(500 * played.start_s, played.spikes.shape[1] / 2, "events do not\ncount yet", fontsize=8,
                       color=GREY, ha="center", va="center")  # fmt: skip
    neurons, steps = played.spikes.shape[1], f"steps of {1e3 * played.step_s:.4g} ms"
    _above(
        panel, played, "hidden", "hidden neurons", f"{played.spikes.sum():,.0f} spikes of {neurons} neurons, {steps}"
    )


def _draw_evidence(panel: Axes, played: ScanToClass) -> None:
    """Draw the evidence of each class, and name the winner and the true class."""
    winner = int(played.evidence[-1].argmax())
    for label, name in enumerate(played.class_names):
        won = label == winner
        panel.plot(played.ends_ms, played.evidence[:, label], color=_colour(label), lw=2.4 if won else 1.1,
                   zorder=3 if won else 2, label=name)  # fmt: skip
    _above(panel, played, "evidence", "evidence for each class", played.meaning)
    panel.set_ylabel("logit", fontsize=8.5)
    top = float(played.evidence[-1, winner])
    low, high = panel.get_ylim()
    for label in dict.fromkeys((winner, played.label)):
        place = top if label == winner else min(float(played.evidence[-1, label]), top - 0.13 * (high - low))
        panel.annotate(played.class_names[label], (1, place), xytext=(5, 0), xycoords=panel.get_yaxis_transform(),
                       textcoords="offset points", ha="left", va="center", fontsize=8.5, color=_colour(label),
                       fontweight="bold" if label == winner else "normal", annotation_clip=False)  # fmt: skip


def _draw_final(panel: Axes, played: ScanToClass) -> None:
    """Draw the SoftMax of the final evidence, and name the true class."""
    shares = np.exp(played.evidence[-1] - played.evidence[-1].max())
    shares = 100 * shares / shares.sum()
    true = played.label
    panel.barh(range(len(shares)), shares, color=[_colour(label) for label in range(len(shares))])
    names = [f"{name} (true)" if label == true else name for label, name in enumerate(played.class_names)]
    panel.set_yticks(range(len(names)), names)
    for label, tick in enumerate(panel.get_yticklabels()):
        tick.set_color(_colour(label))
    panel.invert_yaxis()
    panel.set_xlim(0, 118)
    panel.set_xticks(range(0, 101, 25))
    for label, share in enumerate(shares):
        mark = ", wins" if label == int(shares.argmax()) else ""
        panel.text(share + 1, label, f"{share:.0f} %{mark}", va="center", fontsize=8)
    dress(panel, "SoftMax at the end (%)")
    panel.grid(visible=False)


def _above(panel: Axes, played: ScanToClass, name: str, title: str, text: str) -> None:
    """Write the title of a panel, and its numbers on a line below the title."""
    from matplotlib.transforms import ScaledTranslation

    heading = dress(panel, title)
    text = "; ".join([text, *([played.numbers[name]] if name in played.numbers else [])])
    panel.set_title(text, fontsize=8, color=GREY, pad=4, loc="right", x=0, ha="left")
    heading.set_transform(heading.get_transform() + ScaledTranslation(0, 1 / 6, panel.figure.dpi_scale_trans))


def _colour(label: int) -> str:
    return CLASS_COLOURS[label % len(CLASS_COLOURS)]
