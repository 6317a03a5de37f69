"""Convert event files to event counts per time bin (docs/guide/classifier.md).

Recordings of the RTL and of the model (``eskin.snn.data.record``) pass through the same ``collect``, so equal events
give equal tensors.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eskin.base.configuration import Configuration
from eskin.base.errors import InputError
from eskin.model.address_events import Events, taxel_of
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.skin.textures.presets import preset

MAX_COUNTS = 2**28
"""Most counts of one recording in memory, including zeros."""


@dataclass(frozen=True, kw_only=True)
class BinConfig(Configuration):
    """Parameters of the conversion from events to counts per time bin."""

    bin_s: float = 0.004
    """Length of a time bin in seconds; 10 ms in the authors' later work on their chip, open in the paper."""
    start_s: float | None = None
    stop_s: float | None = None
    """Time window. By default from the first event that counts in the preset of the recording (10 ms for LCS in
    ``paper``, 0 in ``physical``) to the end. A last bin that the window does not fill is left out."""
    polarity: bool = True
    """ON and OFF events of a taxel are two channels; else they are counted together."""

    def __post_init__(self) -> None:
        self._check_types()
        if not (math.isfinite(self.bin_s) and self.bin_s > 0):
            raise InputError(f"bin_s must be a positive number of seconds, not {self.bin_s!r}")
        for name in ("start_s", "stop_s"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value >= 0):
                raise InputError(f"{name} must be a number of seconds from 0, not {value!r}")
        if self.start_s is not None and self.stop_s is not None and self.stop_s <= self.start_s:
            raise InputError(f"stop_s must be later than start_s, not {self.stop_s:g} after {self.start_s:g}")

    def channels(self, config: ReadoutConfig) -> int:
        """Return the number of input channels for a readout: taxels, or twice as many with separate ON and OFF."""
        return config.taxels * (2 if self.polarity and config.has_polarity else 1)

    def channel_of(self, events: Events, config: ReadoutConfig) -> NDArray[np.int64]:
        """Return the input channel of every event."""
        return taxel_of(events, config) + np.where(events["p"], 0, self.channels(config) - config.taxels)


def bin_recording(recording: Recording, bins: BinConfig) -> NDArray[np.int16]:
    """Return the event counts of a recording, shape (steps, channels).

    The link transfer time of an event determines its bin. Channel = taxel index, plus the number of taxels for OFF.

    Raise InputError if the window contains no complete bin, or a bin too many events.
    """
    config, events = recording.config, recording.events
    name = recording.metadata.get("name", "the recording")
    start = counted_from(recording, bins.start_s)
    stop = recording.duration_clocks
    if bins.stop_s is not None:
        stop = min(stop, round(bins.stop_s * config.clock_hz))
    width = bins.bin_s * config.clock_hz
    if not 1 <= width < math.inf:
        raise InputError(
            f"a time bin of {bins.bin_s:g} s does not fit a clock of {config.clock_hz:g} Hz; "
            f"use at least {1 / config.clock_hz:g} s"
        )
    steps = math.floor((stop - start) / width + 1e-9)
    if steps < 1:
        raise InputError(
            f"{name} lasts {recording.duration_s:.6g} s and contains no complete bin of {bins.bin_s:g} s in the time "
            f"window; choose a shorter bin or another window"
        )
    if steps * bins.channels(config) > MAX_COUNTS:
        raise InputError(
            f"{name} has {steps} bins of {bins.bin_s:g} s and {bins.channels(config)} channels, more than "
            f"{MAX_COUNTS} counts; choose a longer bin"
        )
    step = np.floor((events["t"] - start) / width).astype(np.int64)
    seen = (events["t"] >= start) & (step < steps)
    counts = np.zeros((steps, bins.channels(config)), np.int16)
    place, number = np.unique(step[seen] * counts.shape[1] + bins.channel_of(events, config)[seen], return_counts=True)
    if number.max(initial=0) > np.iinfo(np.int16).max:
        raise InputError(f"a time bin of {bins.bin_s:g} s holds {number.max()} events; choose a shorter one")
    counts.ravel()[place] = number
    return counts


def counted_from(recording: Recording, start_s: float | None = None) -> int:
    """Return the clock from which events are counted."""
    if start_s is not None:
        return round(start_s * recording.config.clock_hz)
    name = recording.metadata.get("preset")
    if not isinstance(name, str):
        return 0
    return preset(name).skipped_ticks(recording.config) * recording.config.clocks_per_sample
