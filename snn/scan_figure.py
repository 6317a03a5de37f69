"""Fig. 8: one scan on its way through the network, from the texture to the evidence for each class."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from model.config import ReadoutConfig
from model.dataset import Texture, open_dataset
from model.errors import InputError
from model.events import Recording
from model.plots import dress, new_figure, save_figure
from model.raster import OFF_COLOUR, ON_COLOUR
from model.rates import PAPER_TAU_S
from model.report_data import read_json
from model.scan import Scan
from model.texture import PhysicalScan, preset
from snn.dataset import BinConfig, collect
from snn.exchange import Weights, load_weights
from snn.experiment import stratified_folds
from snn.network import SpikingNetwork
from snn.recurrent import layer
from snn.scans import record

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CLASS_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#999999")
"""Okabe and Ito, and a grey; more classes take them again."""

MEANINGS = {"spikes": "output spikes so far", "membrane": "output membranes so far, divided by all steps"}
"""The evidence, by the readout of the network."""

_GREY = "#555555"
_SHOWN = 3  # taxels whose signal is drawn
_INK = "#333333"


@dataclass(frozen=True, eq=False)
class Played:
    """One scan and what the network makes of it.

    Attributes
    ----------
    texture : Texture
    tested : bool
        The image was none of those that the network learned from.
    scan : Scan
    recording : Recording
        Its events.
    signals : array, shape (ticks, taxels)
        Samples in full scales.
    start_s, step_s : float
        Begin of the first time step, and length of a step.
    spikes : array, shape (steps, hidden)
        Spikes of the hidden neurons, 0 or 1.
    evidence : array, shape (steps, classes)
        See :func:`evidence`.
    class_names : tuple of str
    meaning : str
        What the evidence is, in words.
    """

    texture: Texture
    tested: bool
    scan: Scan
    recording: Recording
    signals: NDArray[np.float64]
    start_s: float
    step_s: float
    spikes: NDArray[np.float32]
    evidence: NDArray[np.float32]
    class_names: tuple[str, ...]
    meaning: str

    @property
    def predicted(self) -> str:
        """Class of the largest evidence at the end."""
        return self.class_names[int(self.evidence[-1].argmax())]

    @property
    def ends_ms(self) -> NDArray[np.floating[Any]]:
        """End of every time step in milliseconds."""
        return 1e3 * (self.start_s + self.step_s * np.arange(1, len(self.spikes) + 1))

    def to_dict(self) -> dict[str, Any]:
        """Return what the network says, for a file: hidden spikes as pairs (step, neuron)."""
        return {
            "image": self.texture.name,
            "of_the_test_fold": self.tested,
            "preset": self.scan.name,
            "readout": self.recording.config.to_dict(),
            "events": len(self.recording.events),
            "start_s": self.start_s,
            "step_s": self.step_s,
            "class_names": list(self.class_names),
            "true": self.texture.class_name,
            "predicted": self.predicted,
            "evidence": self.evidence.tolist(),
            "hidden_spikes": np.argwhere(self.spikes).tolist(),
        }


# -- from weights to a played scan -------------------------------------------------------------------


@torch.no_grad()
def evidence(network: SpikingNetwork, x: Tensor) -> tuple[Tensor, Tensor]:
    """Return hidden spikes and the evidence for each class as it grows; the last step has the network's logits.

    Parameters
    ----------
    network : SpikingNetwork
    x : shape (steps, scans, inputs)

    Returns
    -------
    spikes : shape (steps, scans, hidden)
    evidence : shape (steps, scans, classes)
        Output spikes so far; or the sum of the output membranes so far, divided by the number of all steps.
    """
    config = network.config
    spikes = network.spikes(x)
    _, decay = network.decays()
    if config.readout == "spikes":
        parts = layer(config.rule, spikes, network.w_out, network.b_out, decay, None, network.backend)
    else:
        parts = functional.linear(spikes, network.w_out, network.b_out)
        for step in range(1, len(parts)):
            parts[step] += decay * parts[step - 1]
        parts /= len(parts)
    return spikes, parts.cumsum(0) * config.output_scale


def play(weights_file: Path, result_file: Path, dataset: str | None = None, image: str | None = None) -> Played:
    """Return a scan of the dataset that a network was trained on, played through that network.

    Parameters
    ----------
    weights_file, result_file : Path
        What ``python -m snn train`` wrote: the network, and the experiment that says how scans are made.
    dataset : str, optional
        Place of the textures, where it is another than in training.
    image : str, optional
        Name of the texture; by default the first test image of the fold.

    Raises
    ------
    InputError
        If the two files do not belong together, or are not of a spiking network on textures.
    """
    weights = load_weights(weights_file)
    if not result_file.is_file():
        raise InputError(
            f"{result_file} does not exist, and only the result of the training says how its scans were made; "
            f"name it with --result"
        )
    network = weights.network
    if not isinstance(network, SpikingNetwork):
        raise InputError(f"{weights_file} holds a baseline for frames; fig8 needs a spiking network")
    result = read_json(result_file, "the result of the training")
    try:
        experiment = result["experiment"]
        readout = ReadoutConfig.from_dict(experiment["readout"])
        bins = BinConfig(**experiment["bins"])
        scan = preset(experiment["preset"])
        of_textures = experiment["events"] is None and experiment["frames"] is None
        tau_s, used = experiment["tau_s"], experiment["dataset"]
        fold, folds = int(result["fold"]), int(result["folds"])
    except InputError:
        raise
    except (KeyError, TypeError, ValueError):
        raise InputError(f"{result_file} is not the result of python -m snn train; name that with --result") from None
    if not of_textures:
        raise InputError(f"{result_file} is of a training on event files or frames; fig8 needs one on textures")
    if bins.bin_s != weights.step_s:
        raise InputError(
            f"{result_file} has time bins of {bins.bin_s:g} s, {weights_file} of {weights.step_s:g} s; "
            f"they are of two trainings, name the right one with --result"
        )
    textures = open_dataset(dataset or used)
    if textures.class_names != weights.class_names:
        raise InputError(
            f"the network knows the classes {', '.join(weights.class_names)}, the textures are "
            f"{', '.join(textures.class_names)}; give the textures of the training with --dataset"
        )
    test = stratified_folds(textures.labels, folds)[fold]
    index = int(test[0]) if image is None else _index(image, [texture.name for texture in textures])
    config = scan.configure(readout, (tau_s or PAPER_TAU_S) if readout.encoding == "nlcs" else None)
    return _played(weights, network, textures[index], textures.name, index in test, scan, config, bins)


def _index(image: str, names: list[str]) -> int:
    if image not in names:
        raise InputError(f"no image is called {image!r}; there are {len(names)}, from {names[0]} to {names[-1]}")
    return names.index(image)


def _played(
    weights: Weights,
    network: SpikingNetwork,
    texture: Texture,
    dataset_name: str,
    tested: bool,
    scan: Scan,
    config: ReadoutConfig,
    bins: BinConfig,
) -> Played:
    recording = record(texture, dataset_name, scan, config)
    codes, _ = scan.samples(config, texture.load())
    spikes, grown = evidence(network, collect([recording], bins, weights.class_names).batch([0]))
    scale = network.config.output_scale
    counted_s = scan.skipped_ticks(config) / config.sample_rate_hz
    return Played(
        texture=texture,
        tested=tested,
        scan=scan,
        recording=recording,
        signals=codes / config.full_scale,
        start_s=counted_s if bins.start_s is None else bins.start_s,
        step_s=bins.bin_s,
        spikes=spikes[:, 0].numpy(),
        evidence=grown[:, 0].numpy(),
        class_names=weights.class_names,
        meaning=MEANINGS[network.config.readout] + (f", times {scale:g}" if scale != 1 else ""),
    )


# -- picture -----------------------------------------------------------------------------------------


def plot_fig8(played: Played, path: Path) -> None:
    """Draw a scan on its way through the network; see :func:`draw_fig8`."""
    save_figure(draw_fig8(played), path)


def draw_fig8(played: Played) -> Figure:
    """Return texture, taxel signals with their events, events of all taxels, hidden spikes and evidence."""
    true, predicted = played.texture.class_name, played.predicted
    verdict = "right" if true == predicted else "wrong"
    learned = "test image" if played.tested else "training image"
    figure = new_figure(12, 8.4, f"{played.texture.name} ({learned}): true {true}, predicted {predicted}, {verdict}")
    grid = figure.add_gridspec(4, 2, width_ratios=(1, 2.9), height_ratios=(1.5, 1.3, 1.5, 1.4))
    _draw_texture(figure.add_subplot(grid[:2, 0]), played)
    _draw_zoom(figure.add_subplot(grid[2, 0]), played)
    _draw_final(figure.add_subplot(grid[3, 0]), played)
    panels = [figure.add_subplot(grid[0, 1])]
    panels += [figure.add_subplot(grid[row, 1], sharex=panels[0]) for row in (1, 2, 3)]
    for panel, draw in zip(panels, (_draw_signals, _draw_events, _draw_hidden, _draw_evidence), strict=True):
        draw(panel, played)
        panel.grid(visible=False)
    panels[0].set_xlim(0, 1e3 * played.recording.duration_s)
    panels[-1].set_xlabel("time (ms)", fontsize=8.5)
    return figure


def _draw_texture(panel: Axes, played: Played) -> None:
    """Draw the image, the array where it starts, and the way of the scan."""
    from matplotlib.patches import Rectangle

    config, scan = played.recording.config, played.scan
    pixels = played.texture.load()
    height, width = pixels.shape
    pitch = scan.taxel_pitch_px if isinstance(scan, PhysicalScan) else 1.0
    across, down = ((n - 1) * pitch + 1 for n in (config.columns, config.rows))
    rightwards = isinstance(scan, PhysicalScan) or width > height  # the paper's scan follows the longer side
    if rightwards and not isinstance(scan, PhysicalScan):
        across, down = down, across
    dress(panel, "texture and scan")
    panel.grid(visible=False)
    panel.imshow(pixels, cmap="gray", vmin=0, vmax=255)
    way = (width, down) if rightwards else (across, height)
    panel.add_patch(Rectangle((-0.5, -0.5), *way, color=OFF_COLOUR, alpha=0.3, lw=0))
    panel.add_patch(Rectangle((-0.5, -0.5), across, down, fill=False, ec=OFF_COLOUR, lw=1.8))
    at, to = ((across, down / 2), (width, down / 2)) if rightwards else ((across / 2, down), (across / 2, height))
    panel.annotate("", to, at, arrowprops={"arrowstyle": "->", "color": OFF_COLOUR, "lw": 1.5})
    panel.set_xlabel(f"pixels; {config.rows} x {config.columns} taxels, {scan.name} scan", fontsize=8.5)


def _draw_signals(panel: Axes, played: Played) -> None:
    """Draw the samples of some taxels, one above the other, with their events on the line."""
    shown = _shown(played)
    gap = 1.15 * max(float(np.ptp(played.signals[:, shown], axis=0).max()), 1e-6)
    for lane, taxel in enumerate(shown):
        _draw_taxel(panel, played, int(taxel), -lane * gap, 2.5, slice(None))
    panel.axvspan(*(1e3 * s for s in _zoom(played.recording.duration_s)), color="#e5e5e5", zorder=0)
    panel.set_yticks([-lane * gap for lane in range(len(shown))], [f"taxel {taxel}" for taxel in shown])
    handles, labels = panel.get_legend_handles_labels()
    kinds = len(set(labels))
    panel.legend(handles[:kinds], labels[:kinds], loc="lower right", bbox_to_anchor=(1, 1), ncols=2, frameon=False,
                 fontsize=8, handletextpad=0.1, markerscale=2.5, borderaxespad=0.1)  # fmt: skip
    dress(panel, "pressure signals and their events")
    panel.set_title(f"lanes {gap:.2g} full scales apart", fontsize=8, color=_GREY, pad=4)


def _draw_zoom(panel: Axes, played: Played) -> None:
    """Draw a few milliseconds of one taxel, event by event."""
    config = played.recording.config
    first, last = (round(s * config.sample_rate_hz) for s in _zoom(played.recording.duration_s))
    shown = _shown(played)
    taxel = int(shown[len(shown) // 2])
    _draw_taxel(panel, played, taxel, 0.0, 5.0, slice(first, max(last, first + 2)))
    dress(panel, f"taxel {taxel}, the grey part")
    panel.grid(visible=False)
    panel.set_xlabel("time (ms)", fontsize=8.5)
    panel.set_ylabel("full scales", fontsize=8.5)


def _shown(played: Played) -> NDArray[np.int64]:
    """Return the taxels whose signals are drawn: first, middle and last."""
    return np.unique(np.linspace(0, played.recording.config.taxels - 1, _SHOWN).astype(np.int64))


def _zoom(duration_s: float) -> tuple[float, float]:
    """Return the time window of the closer look, 20 ms where the scan is that long."""
    start_s = duration_s / 4
    return start_s, min(start_s + 0.02, duration_s)


def _draw_taxel(panel: Axes, played: Played, taxel: int, offset: float, size: float, ticks: slice) -> None:
    """Draw the signal of a taxel, moved by an offset, with its events on the line."""
    config, events = played.recording.config, played.recording.events
    signal = played.signals[:, taxel] + offset
    number = np.arange(len(signal))[ticks]
    panel.plot(1e3 * number / config.sample_rate_hz, signal[ticks], color=_INK, lw=0.7)
    index = events["y"].astype(int) * config.columns + events["x"]
    for on, marker, colour in ((True, "^", ON_COLOUR), (False, "v", OFF_COLOUR)):
        clocks = events["t"][(index == taxel) & (events["p"] == on)]
        at = np.minimum(clocks // config.clocks_per_sample, len(signal) - 1)
        inside = (at >= number[0]) & (at <= number[-1])
        if on or config.has_polarity:
            label = ("ON" if on else "OFF") if config.has_polarity else "event"
            panel.plot(1e3 * clocks[inside] / config.clock_hz, signal[at[inside]], marker, color=colour, ms=size,
                       mew=0, label=label)  # fmt: skip


def _draw_events(panel: Axes, played: Played) -> None:
    """Draw the address events of all taxels."""
    config, events = played.recording.config, played.recording.events
    index = events["y"].astype(int) * config.columns + events["x"]
    for on, colour in ((True, ON_COLOUR), (False, OFF_COLOUR)):
        chosen = events["p"] == on
        panel.plot(1e3 * events["t"][chosen] / config.clock_hz, index[chosen], ls="", marker="|", ms=2, mew=0.6,
                   color=colour, alpha=0.8, rasterized=True)  # fmt: skip
    panel.set_ylim(config.taxels - 0.5, -0.5)
    panel.set_ylabel("taxel", fontsize=8.5)
    dress(panel, "address events")
    panel.set_title(f"{len(events):,} events of {config.taxels} taxels", fontsize=8, color=_GREY, pad=4)


def _draw_hidden(panel: Axes, played: Played) -> None:
    """Draw the spikes of the hidden neurons."""
    step, neuron = np.nonzero(played.spikes)
    panel.plot(played.ends_ms[step], neuron, ls="", marker="|", ms=2, mew=0.7, color=_INK, rasterized=True)
    panel.set_ylim(played.spikes.shape[1] - 0.5, -0.5)
    panel.set_ylabel("neuron", fontsize=8.5)
    if played.start_s > 0:
        panel.axvspan(0, 1e3 * played.start_s, color="#eeeeee", zorder=0)
        panel.text(500 * played.start_s, played.spikes.shape[1] / 2, "events do not\ncount yet", fontsize=8,
                   color=_GREY, ha="center", va="center", clip_on=True)  # fmt: skip
    dress(panel, "hidden neurons")
    panel.set_title(f"{played.spikes.sum():,.0f} spikes of {played.spikes.shape[1]} neurons, steps of "
                    f"{1e3 * played.step_s:g} ms", fontsize=8, color=_GREY, pad=4)  # fmt: skip


def _draw_evidence(panel: Axes, played: Played) -> None:
    """Draw the evidence for each class; the winner is thick."""
    winner = int(played.evidence[-1].argmax())
    for label, name in enumerate(played.class_names):
        won = label == winner
        panel.plot(played.ends_ms, played.evidence[:, label], color=_colour(label), lw=2.4 if won else 1.1,
                   zorder=3 if won else 2, label=name)  # fmt: skip
    dress(panel, "evidence for each class")
    panel.set_title(played.meaning, fontsize=8, color=_GREY, pad=4)
    panel.set_ylabel("logit", fontsize=8.5)
    for label in {winner, played.texture.label}:
        panel.annotate(played.class_names[label], (played.ends_ms[-1], played.evidence[-1, label]), xytext=(-6, -4),
                       textcoords="offset points", ha="right", va="top", fontsize=8.5, color=_colour(label),
                       fontweight="bold" if label == winner else "normal")  # fmt: skip


def _draw_final(panel: Axes, played: Played) -> None:
    """Draw the SoftMax of the evidence at the end; the true class is named."""
    shares = np.exp(played.evidence[-1] - played.evidence[-1].max())
    shares = 100 * shares / shares.sum()
    true = played.texture.label
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


def _colour(label: int) -> str:
    return CLASS_COLOURS[label % len(CLASS_COLOURS)]
