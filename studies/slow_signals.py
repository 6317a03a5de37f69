"""Slow signals: SNR and data rate of all encoders and resolutions, and of uniform sampling at no higher rate."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.figures.style import dress, legend_below, new_figure, save_figure
from eskin.base.progress import bar
from eskin.base.workers.engine import Local, Needs, Pool, Shared, each
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.skin.figures.readouts import FRAME, look
from eskin.skin.recordings.fitting import TAU_S, with_clock, with_seconds
from eskin.skin.recordings.folder import read_set
from eskin.skin.recordings.options import Preparation
from eskin.skin.recordings.quality import encoded, pooled
from eskin.skin.textures.presets import quantise
from studies.study import Data, Result, run

RECORDINGS: Path | None = None
"""Class folders of your own recordings; None for generated slow signals."""

RESOLUTIONS = (2, 3, 4, 5, 6, 7, 8, 9, 10)
SAMPLE_BITS = 14  # sample width W of the study: a resolution of 10 bits leaves two bits below the step

UNIFORM_BITS = range(1, SAMPLE_BITS - 1)
"""Bits of uniform sampling, at most two bits below the sample width, so that the SNR is finite."""

RATE_HZ, SECONDS, TAXELS, ROWS = 100.0, 10.0, 16, 4
"""Samples per second, length, taxels and rows of taxels of the generated signals."""

Codes = NDArray[np.int32]


def compute(pool: Pool) -> Data:
    """Return SNR and data rate of every encoder and resolution."""
    with bar("encoding", len(registry.NAMES) * len(RESOLUTIONS)) as step:
        return study_data(RECORDINGS, pool, step)


def slow_signals() -> list[Codes]:
    """Return generated pressure signals of a slow skin as codes: presses, strokes and taps.

    Each taxel has its own gain, and white noise of 1/2000 of full scale rms.
    """
    random = np.random.default_rng(0)
    time_s = np.arange(int(RATE_HZ * SECONDS))[:, None] / RATE_HZ
    taxel = np.arange(TAXELS)[None, :]

    def edge(at_s: float) -> NDArray[np.float64]:
        return np.asarray(1 / (1 + np.exp(-4 * (time_s - at_s - 0.05 * taxel))))

    def bump(at_s: float, width_s: float, delay_s: float) -> NDArray[np.float64]:
        return np.asarray(np.exp(-(((time_s - at_s - delay_s * taxel) / width_s) ** 2)))

    touches = [
        edge(2) - edge(7),
        bump(1, 0.4, 0.4),
        np.sum([bump(at, 0.12, 0.02) for at in (1, 3, 4.5, 6.5, 8.5)], axis=0),
    ]
    signals = []
    for touch in touches:
        gains = random.uniform(0.6, 0.95, TAXELS)
        signals.append(quantise(touch * gains + random.normal(0, 1 / 2000, touch.shape), SAMPLE_BITS)[0])
    return signals


def study_data(
    place: Path | None = None, pool: Pool | None = None, progress: Callable[[], object] | None = None
) -> dict[str, Any]:
    """Return SNR and data rate of every encoder and resolution, and of uniform sampling with no more bit/s.

    - ``place``: a user's recordings, as for ``read_set``; generated slow signals by default.
    - ``pool``: without effect on the result.
    - ``progress``: called after each point.
    """
    base = ReadoutConfig(sample_bits=SAMPLE_BITS)
    if place is None:
        recordings, source = slow_signals(), "generated slow signals"
        base = base.replace(rows=ROWS, columns=TAXELS // ROWS, sample_rate_hz=RATE_HZ)
    else:
        found = read_set(place, Preparation(baseline="first"), base, {"clocks_per_sample"})
        recordings, base, source = found.codes, found.config, found.name
    configs = [
        with_seconds(base.replace(encoding=encoding, resolution=resolution, clocks_per_sample=64), ())
        for encoding in registry.NAMES
        for resolution in RESOLUTIONS
    ]
    points = []
    jobs = ((config,) for config in configs)
    for point in each(pool or Local(1), _point, jobs, Shared.of("recordings", recordings)):
        points.append(point)
        if progress is not None:
            progress()
    return {
        "source": source,
        "rate_hz": base.sample_rate_hz,
        "rows": base.rows,
        "columns": base.columns,
        "recordings": len(recordings),
        "points": points,
    }


def _point(recordings: Sequence[Codes], config: ReadoutConfig) -> dict[str, Any]:
    """Return the results of one configuration, with a clock that suits the slopes of the recordings."""
    config = with_clock(config, recordings)
    quality = pooled([encoded(config, codes)[1] for codes in recordings])
    events_per_s = quality.events / quality.seconds
    bps = events_per_s * config.event_bits
    return {
        "encoding": config.encoding,
        "resolution": config.resolution,
        "snr_db": quality.snr_db,
        "data_rate_bps": bps,
        "events_per_s": events_per_s,
        "clock_hz": config.clock_hz,
        "tau_s": config.tau_s if config.encoder.leaks else None,
        "late": quality.late,
        "merged": quality.merged,
        "uniform": uniform(recordings, bps, config.sample_rate_hz, config.sample_bits),
    }


def uniform(recordings: Sequence[Codes], bps: float, rate_hz: float, sample_bits: int) -> dict[str, Any] | None:
    """Return SNR, bits and frame rate of the best uniform sampling up to a data rate.

    For every number of bits, the function uses the highest sampling rate within the data rate, up to that of the
    recordings; the best SNR counts. The result is None if less than one bit per second remains for a taxel.
    """
    best: dict[str, Any] | None = None
    taxels = recordings[0].shape[1]
    signal = sum(float(((codes - codes.mean(0)) ** 2).sum()) for codes in recordings)
    for bits in UNIFORM_BITS:
        frame_rate_hz = min(bps / (bits * taxels), rate_hz)
        if frame_rate_hz < 1:
            continue
        step = 2 ** (sample_bits - bits)
        noise = 0.0
        for codes in recordings:
            ticks = np.arange(len(codes))
            held = np.ceil(np.floor(ticks * frame_rate_hz / rate_hz + 1e-9) * rate_hz / frame_rate_hz - 1e-9).astype(
                int
            )
            rounded = np.clip(np.rint(codes / step), -(2 ** (bits - 1)), 2 ** (bits - 1) - 1) * step
            noise += float(((codes - rounded[np.minimum(held, ticks)]) ** 2).sum())
        snr_db = float(10 * np.log10(signal / noise)) if noise else float("inf")
        if best is None or snr_db > best["snr_db"]:
            best = {"snr_db": snr_db, "bits": bits, "frame_rate_hz": frame_rate_hz}
    return best


def plot_study(data: dict[str, Any], path: Path) -> None:
    """Plot SNR against data rate: one line for each encoder and one for uniform sampling."""
    figure = new_figure(7.2, 4.4, f"Slow signals: {data['source']}, {data['rate_hz']:g} samples/s")
    panel = figure.subplots()
    dress(panel, "", "data rate (bit/s)", "reconstruction SNR (dB)")
    for encoder in registry.ENCODERS:
        line = [p for p in data["points"] if p["encoding"] == encoder.name and p["data_rate_bps"] > 0]
        places = [(point["data_rate_bps"], point["snr_db"]) for point in line]
        label = encoder.title + (f", tau {1e3 * TAU_S:g} ms" if encoder.leaks else "")
        style: dict[str, Any] = {"color": encoder.colour, "marker": encoder.marker, "lw": 1.3, "ms": 5}
        panel.plot(*np.reshape(places, (-1, 2)).T, label=label, **style)
        if encoder is registry.ENCODERS[0]:  # the lines are alike: labels at one line are enough
            for point, place in zip(line, places, strict=True):
                panel.annotate(f"{point['resolution']} b", place, xytext=(-4, 5), textcoords="offset points",
                               ha="right", fontsize=7.5, color=encoder.colour)  # fmt: skip
    same = sorted((p["data_rate_bps"], p["uniform"]["snr_db"]) for p in data["points"] if p["uniform"])
    frame, label = look(FRAME), "uniform sampling, best bits for the rate"
    panel.plot(*zip(*same, strict=True), color=frame.colour, marker=frame.marker, ms=3, lw=1.0, ls="--", label=label)
    panel.set_xscale("log")
    legend_below(figure, panel.get_legend_handles_labels(), 3)
    save_figure(figure, path)


RESULT = Result("slow_signals", compute, plot_study, needs=Needs(), threads=True)

if __name__ == "__main__":
    run("slow_signals", RESULT)
