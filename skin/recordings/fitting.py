"""Choose a configuration for recordings: array size, clock, and time constants in seconds."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.config import MAX_LEAK_PERIOD, MAX_TAU_ERROR, ReadoutConfig
from eskin.model.encoders.fields import signals
from eskin.model.taxel import decode, encode_timed, slope_limit
from eskin.skin.recordings.options import Preparation
from eskin.skin.recordings.quality import MAX_CLOCKS, clocks_needed, encoded, power_of_two
from eskin.skin.textures.scan import leak_of

TAU_S = 0.2  # time constant of the leak where none is given, the paper's

WINDOW_S = 64 / 20_000
"""Time between two closing steps of a window where none is given: that of the default configuration."""

LEAST_WINDOW = 4
"""Samples between two closing steps at least: a window that closes at every sample follows the noise, and its receiver
cannot tell a step from a wait. On a generated skin of 35 Hz, 6 bit, that has 17 dB, this 38 dB."""

RESOLUTIONS = range(3, 9)  # resolutions that are tried for the events of a classifier

ENOUGH_DB, MAX_TRIED = 15.0, 32
"""Reconstruction SNR that is enough for a classifier, and the recordings on which it is measured."""

SLOW_HZ = 1000.0  # samples per second below which the clock follows the signal, not 64 times the sample rate


def with_seconds(config: ReadoutConfig, given: Collection[str], tau_s: float | None = None) -> ReadoutConfig:
    """Return a configuration whose default time constants keep their duration at any sample rate.

    ``tau_s`` is the time constant that the user chose; raise InputError if the sample rate does not reach it.
    """
    if config.encoder.leaks and not {"leak_shift", "leak_period"} & set(given):
        rate_hz = config.sample_rate_hz
        return config.replace(**(nearest_leak(TAU_S, rate_hz) if tau_s is None else leak_of(tau_s, rate_hz)))
    if config.encoder.windowed and "window_period" not in given:
        return config.replace(window_period=min(max(round(WINDOW_S * config.sample_rate_hz), LEAST_WINDOW), 2**16))
    return config


def nearest_leak(tau_s: float, rate_hz: float) -> dict[str, int]:
    """Return the leak settings for a time constant, or for the nearest reachable one of slow samples."""
    try:
        return leak_of(tau_s, rate_hz)
    except InputError:
        units_s = {shift: -1 / (rate_hz * math.log1p(-(2.0**-shift))) for shift in range(1, 7)}
        periods = {shift: min(max(round(tau_s / unit_s), 1), MAX_LEAK_PERIOD) for shift, unit_s in units_s.items()}
        shift = min(units_s, key=lambda k: abs(math.log(periods[k] * units_s[k] / tau_s)))
        return {"leak_shift": shift, "leak_period": periods[shift]}


def other_leak(config: ReadoutConfig, given: Collection[str]) -> tuple[str, ...]:
    """Return a note if the leak that nobody chose differs from ``TAU_S``."""
    if not config.encoder.leaks or {"leak_shift", "leak_period"} & set(given):
        return ()
    if abs(config.tau_s / TAU_S - 1) <= MAX_TAU_ERROR:
        return ()
    return (
        f"the leak has a time constant of {config.tau_s:.3g} s, the nearest to {TAU_S:g} s at "
        f"{config.sample_rate_hz:g} samples/s; --tau chooses another",
    )


@dataclass(frozen=True)
class Fit:
    """Choice of a configuration: resolution by the reconstruction SNR, scale and offsets from all recordings.

    A subclass may choose otherwise; its ``repr`` names all of its parameters.
    """

    tau_s: float | None = None  # time constant of leaky encoders that the user chose

    def learned(self, names: Sequence[str], classes: Sequence[str], groups: Sequence[str]) -> NDArray[np.int64]:
        """Return the numbers of the recordings from which to choose, by the names, classes and groups of all."""
        return np.arange(len(names))

    def variants(self, options: Preparation, given: Collection[str], number: int) -> tuple[Preparation, ...]:
        """Return the preparations to compare on a number of recordings, first that of the user."""
        return (options,)

    def choose(
        self,
        config: ReadoutConfig,
        given: Collection[str],
        classes: Sequence[str],
        groups: Sequence[str],
        recordings: Mapping[Preparation, Sequence[NDArray[np.int32]]],
        levels: Mapping[Preparation, NDArray[np.float64]],
        progress: Callable[[], object],
    ) -> tuple[ReadoutConfig, Preparation, str, list[dict[str, Any]]]:
        """Return a configuration in which the given fields are unchanged, the preparation, a note, and scores.

        The note may be empty. The preparation is the first one. The resolution is the coarsest one that represents
        half of the taxels with at least ``ENOUGH_DB`` on some recordings, evenly spread. Where none does, as with a
        leak, it stays as it is.

        - ``given``: fields that the user set.
        - ``classes``, ``groups``: class and group of each recording.
        - ``recordings``: codes of the ``learned`` recordings by preparation, each of shape (ticks, taxels).
        - ``levels``: fixed offset of each taxel in codes by preparation.
        - ``progress``: called after each setting that is tried.
        """
        options, codes_of_all = next(iter(recordings.items()))
        if "resolution" in given:
            return config, options, "", []
        some = codes_of_all[:: -(-len(codes_of_all) // MAX_TRIED)]
        for resolution in RESOLUTIONS:
            tried = config.replace(resolution=resolution, clocks_per_sample=MAX_CLOCKS)
            signal = noise = np.zeros(config.taxels)
            for codes in some:
                counts, late = encode_timed(tried, codes)
                codes = signals(tried, codes)
                signal = signal + ((codes - codes.mean(0)) ** 2).sum(0)
                noise = noise + ((codes - decode(tried, counts, late)) ** 2).sum(0)
            if np.median(signal / np.maximum(noise, 1e-9)) >= 10 ** (ENOUGH_DB / 10):
                config = config.replace(resolution=resolution)
                break
        return config, options, f"resolution {config.resolution} b; --resolution chooses another", []


def with_clock(config: ReadoutConfig, recordings: Sequence[NDArray[np.int32]]) -> ReadoutConfig:
    """Return a configuration with enough clocks per sample to send all events of a tick within the tick.

    The number is a power of two from 64 on. It is estimated from the largest number of events of one tick, and then
    doubled until the readout neither delays nor merges one in the recording that has it, as far as 2**20.

    The recordings are codes, shape (ticks, taxels).
    """
    needed = [clocks_needed(config, codes) for codes in recordings]
    steepest, clocks = recordings[int(np.argmax(needed))], power_of_two(max(needed))
    while True:
        suited = config.replace(clocks_per_sample=clocks)
        _, quality = encoded(suited, steepest)
        if not (quality.late or quality.merged) or clocks >= MAX_CLOCKS:
            return suited
        clocks *= 2


def steepest_step(config: ReadoutConfig, recordings: Sequence[NDArray[np.int32]]) -> tuple[int, float]:
    """Return the largest step between two samples in codes, and the slope limit."""
    largest = 0
    for codes in recordings:
        codes = signals(config, codes)
        steps = np.abs(np.diff(codes, axis=0, prepend=np.full((1, codes.shape[1]), config.reference_reset)))
        largest = max(largest, int(steps.max()))
    return largest, slope_limit(config)
