"""Measure the data rate of readouts during movement and at rest (docs/results/what_events_are_good_for.md).

The array slides over a texture, and then its last column repeats: the pressure no longer changes, and the high-pass of
the sensor lets the signal decay. All readouts receive the same signals with the same AFE noise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.textures.dataset import Dataset
from eskin.skin.textures.physical import PhysicalScan
from eskin.skin.textures.scan import quantise
from eskin.snn.data.coding import coded_events, coded_frames
from eskin.snn.data.disturb import noisy
from eskin.snn.data.frame_steps import FrameSteps
from eskin.snn.data.frames import sampled_config
from eskin.snn.data.record import recorded

REST_S = 0.6
"""Seconds of the scan after the texture ended."""

SETTLED_S = 0.3
"""Last seconds of the scan, which count as rest; they begin two time constants of the high-pass after the texture."""

Readout = ReadoutConfig | FrameSteps


def bits_per_second(
    dataset: Dataset, readouts: dict[str, Readout], noises_v: Sequence[float], tick: Callable[[], object]
) -> list[dict[str, Any]]:
    """Return sent and compressed bits per second of every readout and noise, moving and resting."""
    scan, found = PhysicalScan(), []
    for name, readout in readouts.items():
        array = readout if isinstance(readout, ReadoutConfig) else ReadoutConfig()
        config = sampled_config(readout, array) if isinstance(readout, FrameSteps) else scan.configure(readout)
        kept: list[list[Any]] = [[] for _ in noises_v]
        for image, texture in enumerate(dataset):
            more = round(REST_S * scan.speed_m_per_s / scan.pixel_pitch_m)
            signals = scan.signals(config, np.pad(texture.load(), ((0, 0), (0, more)), "edge"))
            for number, (noise_v, streams) in enumerate(zip(noises_v, kept, strict=True)):
                generator = np.random.default_rng([number, image])
                made = noisy(signals, noise_v, generator) if noise_v else signals
                codes = quantise(made, config.sample_bits)[0]
                streams.append(codes if isinstance(readout, FrameSteps) else recorded(config, codes, {}))
            tick()
        for noise_v, streams in zip(noises_v, kept, strict=True):
            for phase in ("moving", "resting"):
                sent = (
                    _of_frames(readout, streams, phase)
                    if isinstance(readout, FrameSteps)
                    else _of_events(readout, streams, phase)
                )
                found.append({"readout": name, "noise_v": noise_v, "phase": phase, **sent})
    return found


def _part(total: int, per_second: float, phase: str) -> tuple[int, int]:
    """Return begin and end of a phase: moving over the texture, or resting."""
    if phase == "moving":
        return 0, total - round(REST_S * per_second)
    return total - round(SETTLED_S * per_second), total


def _of_events(config: ReadoutConfig, recordings: Sequence[Recording], phase: str) -> dict[str, float]:
    parts = []
    for recording in recordings:
        begin, end = _part(recording.duration_clocks, recording.clock_hz, phase)
        events = recording.events
        events = events[(events["t"] >= begin) & (events["t"] < end)].copy()
        events["t"] -= begin
        parts.append(Recording(events, recording.config, end - begin))
    seconds = sum(part.duration_s for part in parts)
    sent = sum(len(part.events) for part in parts) * config.event_bits
    return {"sent_bps": sent / seconds, "coded_bps": coded_events(parts)["events"] / seconds}


def _of_frames(frames: FrameSteps, codes: Sequence[NDArray[np.int32]], phase: str) -> dict[str, float]:
    parts = [one[slice(*_part(len(one), frames.rate_hz, phase))] for one in codes]
    seconds = sum(map(len, parts)) / frames.rate_hz
    coded = min(coded_frames(parts, frames.bits).values())
    return {"sent_bps": frames.rate_hz * parts[0].shape[1] * frames.bits, "coded_bps": coded / seconds}
