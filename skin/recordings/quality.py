"""Measure the quality of encoded events: link load, late and merged decisions, reconstruction error."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.address_events import Events, taxel_of
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import signals
from eskin.model.events.recording import Recording
from eskin.model.readout import Stimulus, simulate
from eskin.model.taxel import EVENT_LATENCY, counts_of_events, decode, encode, error_bound

MAX_VALUES = 2**28  # largest number of reconstructed values (2 GiB)
MUCH_LATE = 0.01  # part of the events above which late events or merged decisions cause a warning

LEAST_CLOCKS, MAX_CLOCKS = 64, 2**20
"""Range of the clocks per sample that fit a signal; the largest number is enough for every decision."""


@dataclass(frozen=True)
class Quality:
    """The quality of the events of a readout; :func:`pooled` combines several recordings."""

    samples: int  # ticks times taxels
    seconds: float
    events: int  # that left
    expected: int  # events without contention
    late: int  # events that left after the tick of their cause
    merged: int  # decisions that never became events of their own
    load: float  # part of the time in which the link is busy
    peak_load: float  # the load in the worst tick
    signal: float  # mean square, in codes, of the samples about the mean of their taxel
    noise: float  # mean square, in codes, of the difference between samples and reconstruction
    silent: frozenset[int]  # taxels without an event
    bound_holds: bool  # the difference stays in the bound of the decoder at every tick (without OFF: its upper end)

    @property
    def snr_db(self) -> float:
        """SNR of the reconstruction in dB; infinite without error."""
        if not self.noise or not self.signal:
            return math.inf if not self.noise else -math.inf
        return 10 * math.log10(self.signal / self.noise)


def measure_quality(config: ReadoutConfig, codes: NDArray[np.int32], events: Events) -> Quality:
    """Return the quality of the events encoded from given codes, shape (ticks, taxels).

    The times of the events count from the first sample on.
    """
    expected = np.abs(encode(config, codes).astype(np.int64))
    counts, late = counts_of_events(config, events, len(codes))
    sent = np.zeros(expected.shape, np.int64)
    tick = (events["t"] - EVENT_LATENCY) // config.clocks_per_sample
    seen = (tick >= 0) & (tick < len(codes))
    np.add.at(sent, (tick[seen], taxel_of(events, config)[seen]), 1)
    codes = signals(config, codes)
    per_tick, cost = sent.sum(1), config.protocol.clocks_per_event
    error = codes - decode(config, counts, late)
    low, high = error_bound(config)
    holds = bool(error.max() <= high and (not config.has_polarity or error.min() >= low))
    return Quality(
        samples=codes.size,
        seconds=len(codes) / config.sample_rate_hz,
        events=len(events),
        expected=int(expected.sum()),
        late=int(np.maximum(sent - expected, 0).sum()),
        merged=max(int(expected.sum()) - len(events), 0),
        load=cost * len(events) / (len(codes) * config.clocks_per_sample),
        peak_load=cost * int(per_tick.max()) / config.clocks_per_sample,
        signal=float(np.mean((codes - codes.mean(0)) ** 2)),
        noise=float(np.mean(error**2)),
        silent=frozenset(np.flatnonzero(~sent.any(0)).tolist()),
        bound_holds=holds,
    )


def encoded(config: ReadoutConfig, codes: NDArray[np.int32]) -> tuple[Events, Quality]:
    """Return the events of codes, shape (ticks, taxels), from the cycle-accurate model, and their quality."""
    events = simulate(config, Stimulus.from_samples(config, codes))
    return events, measure_quality(config, codes, events)


def link_warning(config: ReadoutConfig, codes: NDArray[np.int32]) -> str:
    """Return a warning about events that the link delays or merges, with the option that helps.

    Empty if at most ``MUCH_LATE`` of the decisions merge.
    """
    _, quality = encoded(config, codes)
    if quality.merged <= MUCH_LATE * quality.expected:
        return ""
    enough = power_of_two(clocks_needed(config, codes))
    return (
        f"the link is too slow for the busiest samples: of {quality.expected} events {quality.late} leave after the "
        f"next sample and {quality.merged} merge with others, at a mean load of {min(quality.load, 1):.0%}; a faster "
        f"clock helps, with --clocks-per-sample {enough} (an estimate)"
    )


def clocks_needed(config: ReadoutConfig, codes: NDArray[np.int32]) -> int:
    """Return an estimate of the clocks per sample needed to send all events of every tick.

    From the largest number of events of one tick, without contention.
    """
    counts = np.abs(encode(config.replace(clocks_per_sample=MAX_CLOCKS), codes).astype(np.int64))
    return config.protocol.clocks_per_event * int(counts.sum(1).max()) + 4 * int(counts.max()) + 8


def power_of_two(clocks: int) -> int:
    """Return the next power of two, limited to ``LEAST_CLOCKS`` to ``MAX_CLOCKS``."""
    return min(max(LEAST_CLOCKS, 1 << (clocks - 1).bit_length()), MAX_CLOCKS)


def pooled(parts: list[Quality]) -> Quality:
    """Return the quality of several recordings together: weighted means and worst peaks."""
    counts = {
        name: sum(getattr(p, name) for p in parts) for name in ("samples", "events", "expected", "late", "merged")
    }
    seconds = math.fsum(p.seconds for p in parts)
    return Quality(
        **counts,
        seconds=seconds,
        load=math.fsum(p.load * p.seconds for p in parts) / seconds,
        peak_load=max(p.peak_load for p in parts),
        signal=math.fsum(p.signal * p.samples for p in parts) / counts["samples"],
        noise=math.fsum(p.noise * p.samples for p in parts) / counts["samples"],
        silent=frozenset.intersection(*(p.silent for p in parts)),
        bound_holds=all(p.bound_holds for p in parts),
    )


def names_and_start(recording: Recording) -> tuple[list[str], float | None]:
    """Return the taxel names of a recording, and the time of its first sample in seconds."""
    names, start_s = recording.metadata.get("columns"), recording.metadata.get("start_s")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        names = []
    known = isinstance(start_s, (int, float)) and math.isfinite(start_s)
    return names, float(start_s) if known else None  # type: ignore[arg-type]


def decode_recording(recording: Recording) -> NDArray[np.float64]:
    """Return the reconstructed signals of a recording, shape (ticks, taxels), in full scale.

    An event counts for the sample tick in which it left, (t - 3) // clocks_per_sample. An event that waited for the
    link may count for a later tick than its cause, or for none after the last tick.
    """
    config = recording.config
    ticks = -(-recording.duration_clocks // config.clocks_per_sample)
    stated = recording.metadata.get("ticks")  # a recording may last longer than its samples, to see the last events
    if type(stated) is int and 0 <= stated < ticks:
        ticks = stated
    if ticks * config.taxels > MAX_VALUES:
        raise InputError(
            f"the recording lasts {ticks} ticks of {config.taxels} taxels, more than decode writes "
            f"({MAX_VALUES} values); cut it into shorter ones"
        )
    counts, late = counts_of_events(config, recording.events, ticks)
    return decode(config, counts, late) / config.full_scale
