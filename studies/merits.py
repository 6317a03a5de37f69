"""Merits: events and frames by latency, data rate at rest, noise and timing error.

The latency is that of the networks in ``out/train*/NETWORK/TRAINING``. The figure also shows the accuracies under noise
that ``python -m studies.noise_power`` has written.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.figures.style import GREY, PALETTE, dress, new_figure, save_figure
from eskin.base.progress import bar
from eskin.base.shapes import read_shaped
from eskin.model.address_events import taxel_of
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.model.taxel import encode, uncontended_events
from eskin.skin.figures.readouts import FRAME, look
from eskin.skin.textures.dataset import Dataset, open_dataset
from eskin.skin.textures.physical import PhysicalScan
from eskin.skin.textures.scan import quantise
from eskin.snn.data.coding import events_bps, frames_bps
from eskin.snn.data.disturb import noisy
from eskin.snn.data.frame_steps import FrameSteps
from eskin.snn.data.frames import sampled_config
from eskin.snn.data.record import recorded
from eskin.snn.experiments.experiment import Experiment
from studies.drawing import draw_networks, label, network_styles
from studies.networks import Subject, all_pairs, by_case, in_words, logits_after, score_of, trained_networks
from studies.study import OUT, Data, Result, run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Readout = ReadoutConfig | FrameSteps

LCS = ReadoutConfig(encoding="lcs", resolution=3)
READOUTS: dict[str, Readout] = {
    "lcs:3": LCS,
    "cw-lcs:3": ReadoutConfig(encoding="cw-lcs", resolution=3),
    "nlcs:6": ReadoutConfig(encoding="nlcs", resolution=6),
    "frame:500:6": FrameSteps(rate_hz=500.0, bits=6, frames_per_step=2),
}
"""Readouts at rest, by their names in the result."""

NOISES_V = (0.0, 1e-3, 3e-3, 1e-2)
FRAMES_HZ = (250.0, 500.0, 1000.0, 5000.0, 20000.0)
"""Frame rates for the comparison of timing with events."""


TEXTURES = 12
"""Number of textures for rest and timing, evenly spread."""

TIMES_S = (0.010, 0.014, 0.018, 0.022, 0.026, 0.030, 0.040, 0.050, 0.070, 0.100, 0.150, 0.200, 0.300, 0.398)
"""Times of the answers after the start of the scan."""

NOISE = {"points": [{"mode": str, "network": str, "noise_v": float, "accuracy": float, "bootstrap_95": [float]}]}
"""Fields of ``noise_power.json`` that the figure needs."""

INTERPOLATED = PALETTE["sky"], "D"
"""Colour and marker of crossings that are interpolated between frames."""


def compute() -> Data:
    """Return latency, data rates at rest and timing errors, and the accuracies of the study noise_power."""
    subjects, textures = trained_networks(), open_dataset(None).limit(TEXTURES)
    with bar("latency", len(subjects) * len(TIMES_S)) as step:
        latency = latency_points(subjects, TIMES_S, step)
    with bar("rest", len(textures) * len(READOUTS)) as step:
        rest = bits_per_second(textures, READOUTS, NOISES_V, step)
    with bar("timing", len(textures)) as step:
        frames = [FrameSteps(rate_hz=rate, bits=8, frames_per_step=1) for rate in FRAMES_HZ]
        timing = timing_points(textures, LCS, frames, step)
    noise = OUT / "data" / "classifier" / "noise_power.json"
    return {
        "latency": latency,
        "latency_pairs": all_pairs(latency, ("time_s",)),
        "rest": rest,
        "timing": timing,
        "textures": len(textures),
        "noise": read_shaped(noise, "the noise study", NOISE)["points"] if noise.exists() else [],
    }


# -- latency -----------------------------------------------------------------------------------------


def latency_points(
    subjects: Sequence[Subject], times_s: Sequence[float], tick: Callable[[], object]
) -> list[dict[str, Any]]:
    """Return accuracy and predictions of every network at given times after the start of the scan.

    A network has seen the steps that are whole by then; before the first it has no answer, which is wrong.
    """
    answers = []
    for subject in subjects:
        data = subject.experiment.data()
        scans = data.first_scans(subject.images)
        begin_s = begin_of(subject.experiment)
        about = {name: getattr(subject, name) for name in ("network", "fold", "seed")}
        about |= {"images": data.images[scans].tolist(), "labels": data.labels[scans]}
        for time_s in times_s:
            steps = int((time_s - begin_s) / data.step_s + 1e-9)
            predicted = np.full(len(scans), -1)
            if steps > 0:
                predicted = logits_after(steps, subject.weights.network, data, scans).argmax(1)
            answers.append(about | {"time_s": time_s, "predicted": predicted})
            tick()
    found = []
    for case, parts in by_case(answers, "network", "time_s"):
        score = score_of(parts)
        kept = {name: score[name] for name in ("accuracy", "bootstrap_95", "images")}
        found.append(case | kept | {"answers": in_words(parts)})
    return found


def begin_of(experiment: Experiment) -> float:
    """Return the time in seconds from the start of a scan to the first network step."""
    if experiment.frames is not None:
        return 0.0
    if experiment.bins.start_s is not None:
        return experiment.bins.start_s
    scan, config = experiment.scan_and_config()
    return scan.skipped_ticks(config) / config.sample_rate_hz


# -- rest --------------------------------------------------------------------------------------------

REST_S = 0.6
"""Seconds of the scan after the texture ended."""

SETTLED_S = 0.3
"""Last seconds of the scan, which count as rest; they begin two time constants of the high-pass after the texture."""


def bits_per_second(
    dataset: Dataset, readouts: dict[str, Readout], noises_v: Sequence[float], tick: Callable[[], object]
) -> list[dict[str, Any]]:
    """Return sent and compressed bits per second of every readout and noise, moving and resting.

    The array slides over a texture, and then its last column repeats: the pressure no longer changes, and the high-pass
    of the sensor lets the signal decay. All readouts receive the same signals with the same AFE noise.
    """
    scan, found = PhysicalScan(), []
    more = round(REST_S * scan.speed_m_per_s / scan.pixel_pitch_m)
    for name, readout in readouts.items():
        frames = readout if isinstance(readout, FrameSteps) else None
        config = scan.configure(readout) if isinstance(readout, ReadoutConfig) else sampled_config(readout, LCS)
        kept: list[list[Any]] = [[] for _ in noises_v]
        for image, texture in enumerate(dataset):
            signals = scan.signals(config, np.pad(texture.load(), ((0, 0), (0, more)), "edge"))
            for number, (noise_v, streams) in enumerate(zip(noises_v, kept, strict=True)):
                generator = np.random.default_rng([number, image])
                made = noisy(signals, noise_v, generator) if noise_v else signals
                codes = quantise(made, config.sample_bits)[0]
                streams.append(recorded(config, codes, {}) if frames is None else codes)
            tick()
        for noise_v, streams in zip(noises_v, kept, strict=True):
            for phase in ("moving", "resting"):
                sent = _of_events(streams, phase) if frames is None else _of_frames(frames, streams, phase)
                found.append({"readout": name, "noise_v": noise_v, "phase": phase, **sent})
    return found


def _part(total: int, per_second: float, phase: str) -> tuple[int, int]:
    """Return begin and end of a phase: moving over the texture, or resting."""
    if phase == "moving":
        return 0, total - round(REST_S * per_second)
    return total - round(SETTLED_S * per_second), total


def _of_events(recordings: Sequence[Recording], phase: str) -> dict[str, float]:
    parts = []
    for recording in recordings:
        begin, end = _part(recording.duration_clocks, recording.clock_hz, phase)
        events = recording.events
        events = events[(events["t"] >= begin) & (events["t"] < end)].copy()
        events["t"] -= begin
        parts.append(Recording(events, recording.config, end - begin))
    sent = sum(len(part.events) for part in parts) * recordings[0].config.event_bits
    return {"sent_bps": sent / sum(part.duration_s for part in parts), "coded_bps": events_bps(parts)["events"]}


def _of_frames(frames: FrameSteps, codes: Sequence[NDArray[np.int32]], phase: str) -> dict[str, float]:
    parts = [one[slice(*_part(len(one), frames.rate_hz, phase))] for one in codes]
    sent_bps = frames.rate_hz * parts[0].shape[1] * frames.bits
    return {"sent_bps": sent_bps, "coded_bps": min(frames_bps(parts, frames).values())}


# -- timing ------------------------------------------------------------------------------------------

FINE_HZ = 100_000.0
"""Samples per second of the signal whose level crossings are the true ones."""
NEAR_S = 0.02
"""Largest time in seconds between a true crossing and its found crossing."""

Crossings = dict[tuple[int, int, bool], NDArray[np.float64]]
"""Times in seconds by taxel, level and direction."""


def timing_points(
    dataset: Dataset, config: ReadoutConfig, frames: Sequence[FrameSteps], tick: Callable[[], object]
) -> list[dict[str, Any]]:
    """Return the share of level crossings found and their timing errors, for events and frames.

    A found crossing is assigned to the nearest true crossing of the same taxel, level and direction; each true crossing
    may be found once. Frames are judged with and without interpolation.

    ``config`` is of LCS, at its own sample rate and with its arbiter and link.
    """
    scan = PhysicalScan()
    fine = config.replace(sample_rate_hz=FINE_HZ, sample_bits=16, decide_every="clock")
    errors: dict[tuple[str, float], list[NDArray[np.float64]]] = {}
    bits: dict[tuple[str, float], float] = {}
    truths = 0
    for texture in dataset:
        true = _crossings(fine, quantise(scan.signals(fine, texture.load()), 16)[0])
        truths += sum(map(len, true.values()))
        codes = quantise(scan.signals(config, texture.load()), config.sample_bits)[0]
        sent = recorded(config, codes, {})
        key = ("events", config.sample_rate_hz)
        errors.setdefault(key, []).append(_errors(true, _levels(sent.events, config, config.clock_hz)))
        bits[key] = bits.get(key, 0.0) + len(sent.events) * config.event_bits / sent.duration_s / len(dataset)
        for one in frames:
            sampled = scan.signals(sampled_config(one, config), texture.load())
            for name in ("frames", "interpolated"):
                key = (name, one.rate_hz)
                bits[key] = one.rate_hz * config.taxels * one.bits
                errors.setdefault(key, []).append(_errors(true, _crossings_of_frames(fine, sampled, one, name)))
        tick()
    return [_point(name, rate_hz, found, truths, bits[name, rate_hz]) for (name, rate_hz), found in errors.items()]


def _point(name: str, rate_hz: float, found: list[Any], truths: int, bps: float) -> dict[str, Any]:
    errors = np.concatenate(found)
    sizes = np.abs(errors)
    return {
        "known_from": name,
        "rate_hz": rate_hz,
        "sent_bps": bps,
        "found": len(errors) / truths,
        "median_s": float(np.median(sizes)),
        "p95_s": float(np.quantile(sizes, 0.95)),
        "mean_s": float(errors.mean()),
        "deviation_s": float(errors.std()),
    }


def _crossings_of_frames(fine: ReadoutConfig, signals: NDArray[np.float64], frames: FrameSteps, name: str) -> Crossings:
    """Return the level crossings found in frames: at the next frame, or by linear interpolation."""
    codes = quantise(signals, frames.bits)[0].astype(float) * 2.0 ** (fine.sample_bits - frames.bits)
    if name == "frames":
        config = fine.replace(sample_rate_hz=frames.rate_hz)
        return _crossings(config, codes.astype(np.int32), 0.0)
    ticks = np.arange(int((len(codes) - 1) * FINE_HZ / frames.rate_hz) + 1)
    lines = [np.interp(ticks / FINE_HZ, np.arange(len(codes)) / frames.rate_hz, column) for column in codes.T]
    return _crossings(fine, np.rint(np.stack(lines, 1)).astype(np.int32))


def _crossings(config: ReadoutConfig, codes: NDArray[np.int32], late_s: float | None = None) -> Crossings:
    """Return the level crossings of an encoder without arbiter."""
    events = uncontended_events(config, encode(config, codes))
    half = 0.5 / config.sample_rate_hz if late_s is None else late_s
    events["t"] = events["t"] // config.clocks_per_sample
    return {key: times - half for key, times in _levels(events, config, config.sample_rate_hz).items()}


def _levels(events: Any, config: ReadoutConfig, ticks_per_s: float) -> Crossings:
    """Return the times of LCS events by taxel, level and direction."""
    taxels, signs = taxel_of(events, config), np.where(events["p"], 1, -1)
    found: Crossings = {}
    for taxel in range(config.taxels):
        own = taxels == taxel
        level, up = np.cumsum(signs[own]), events["p"][own]
        times = events["t"][own] / ticks_per_s
        for key in set(zip(level.tolist(), up.tolist(), strict=True)):
            found[taxel, key[0], key[1]] = times[(level == key[0]) & (up == key[1])]
    return found


def _errors(true: Crossings, found: Crossings) -> NDArray[np.float64]:
    """Return the timing errors in seconds of all level crossings that were found."""
    errors = []
    for key, times in true.items():
        if key not in found:
            continue
        others = found[key]
        place = np.searchsorted(others, times)
        near = [others[np.clip(place + shift, 0, len(others) - 1)] - times for shift in (-1, 0)]
        best = np.where(np.abs(near[0]) < np.abs(near[1]), near[0], near[1])
        nearest = times + best  # a found crossing counts only for the nearest true crossing
        for value in np.unique(nearest):
            own = best[nearest == value]
            errors.append(own[np.abs(own).argmin()])
    kept = np.array(errors)
    return kept[np.abs(kept) <= NEAR_S]


# -- figure ------------------------------------------------------------------------------------------


def plot_merits(result: dict[str, Any], path: Path) -> None:
    """Plot latency, data rate at rest, timing error and noise."""
    figure = new_figure(11, 9, "What events and frames are good for")
    axes = figure.subplots(2, 2).ravel()
    _curves(axes[0], result["latency"], "time_s", "how soon after a touch", "time since the touch (ms)")
    _rest(axes[1], result["rest"])
    _timing(axes[2], result["timing"])
    of_paper = [point for point in result["noise"] if point["mode"] == "paper"]
    _curves(axes[3], of_paper, "noise_v", "how much noise", "AFE noise, white to 10 kHz (mV rms)")
    for axis in axes:
        if axis.get_legend_handles_labels()[0]:
            axis.legend(
                fontsize=7.5, frameon=False, ncols=3, handlelength=3, loc="upper left", bbox_to_anchor=(-0.02, -0.13)
            )
    save_figure(figure, path)


def _curves(axis: Axes, points: list[dict[str, Any]], key: str, title: str, across: str) -> None:
    dress(axis, title, across, "accuracy (%)")
    draw_networks(axis, points, lambda point: 1e3 * point[key], network_styles(points))
    axis.set_xscale("log")
    axis.set_ylim(0, 103)
    axis.xaxis.set_major_formatter(lambda x, _: f"{x:g}")


def _rest(axis: Axes, rows: list[dict[str, Any]]) -> None:
    dress(axis, "data rate of a touch that moves (full) and rests (open)", "AFE noise (mV rms)", "data rate (kb/s)")
    noises = list(dict.fromkeys(row["noise_v"] for row in rows))
    for number, readout in enumerate(dict.fromkeys(row["readout"] for row in rows)):
        _, colour, marker = look(readout.partition(":")[0])
        for phase in ("moving", "resting"):
            own = [row for row in rows if (row["readout"], row["phase"]) == (readout, phase)]
            at = [noises.index(row["noise_v"]) + 0.08 * number for row in own]
            fill = colour if phase == "moving" else "none"
            name = label(readout) if phase == "moving" else None
            sent = [max(1e-3 * row["sent_bps"], 0.01) for row in own]
            axis.plot(at, sent, color=colour, marker=marker, markerfacecolor=fill, linestyle="none", label=name)
            coded = [max(1e-3 * row["coded_bps"], 0.01) for row in own]
            axis.plot(at, coded, color=colour, marker="+", linestyle="none", markersize=4)
    axis.plot([], [], color=GREY, marker="+", linestyle="none", markersize=4, label="after lossless coding")
    axis.set_yscale("log")
    axis.yaxis.set_major_formatter(lambda y, _: f"{y:g}" if y > 0.011 else "0.01 or less")
    axis.set_xticks([0.12 + place for place in range(len(noises))], [f"{1e3 * noise:g}" for noise in noises])


def _timing(axis: Axes, rows: list[dict[str, Any]]) -> None:
    dress(axis, "how well the time of a crossing is known (median, bar to 95 %)", "data rate (kb/s)", "error (us)")
    looks = {"events": look("lcs")[1:], "frames": look(FRAME)[1:], "interpolated": INTERPOLATED}
    names = {"events": "LCS 3 b", "frames": "frames", "interpolated": "frames, interpolated"}
    for name in dict.fromkeys(row["known_from"] for row in rows):
        own = [row for row in rows if row["known_from"] == name]
        x, y = [1e-3 * row["sent_bps"] for row in own], [1e6 * row["median_s"] for row in own]
        up = [1e6 * (row["p95_s"] - row["median_s"]) for row in own]
        colour, marker = looks[name]
        axis.errorbar(x, y, [[0.0] * len(up), up], label=names[name], color=colour, marker=marker, markersize=4,
                      capsize=2)  # fmt: skip
    axis.set_xscale("log")
    axis.set_yscale("log")


RESULT = Result("classifier/merits", compute, plot_merits, long=True)

if __name__ == "__main__":
    run("merits", RESULT)
