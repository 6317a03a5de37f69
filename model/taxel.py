"""The three encoders of a taxel and their decoders, integer-exact and without contention (docs/reference/encoders.md).

A request is taken in the clock after it was raised, as with one taxel and a sink that is always ready. The
model starts with the first sample: should the reference reset so far from 0 that it fires at the silent
input before the first sample, those events are not seen here.

A tick is a sample tick; its first decision falls in the clock after ``sample_valid``. The kernels take all
decisions of a tick at once, in closed form.

All events of one tick have the same sign, and follow each other clock by clock. An event moves the reference
to a level between itself and the sample, never beyond: ON needs x - u >= h and leaves x - u >= 0, which no
later OFF (x - u < -h) follows; OFF needs x - u < -h and leaves x - u < 0, which no later ON (x - u >= h > 0)
follows. N-LCS has no OFF. So a sample, which lies on the scale, never takes the reference off it either. Only the
first event may come late, in the second decision of the tick: where a window closed, or a reference leaked, in the
first. ``encode_timed`` tells these ticks apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model import taxel_kernels as kernels
from model.config import ReadoutConfig
from model.decay import decay_phases, leak_of
from model.errors import InputError
from model.events.address import EVENT_DTYPE, Events, taxel_of

Samples = NDArray[np.integer[Any]]
"""Codes of W bits, shape (ticks, taxels)."""

Counts = NDArray[np.signedinteger[Any]]
"""Signed events after each sample, shape (ticks, taxels): +n is n ON events, -n is n OFF events."""

Flags = NDArray[np.bool_]
"""One flag for each sample, shape (ticks, taxels)."""

EVENT_LATENCY = 3
"""Clocks from ``sample_valid`` to the first event that it causes (docs/design/microarchitecture.md, Time)."""

_BLOCK_BYTES = 2**20
"""Samples handled at a time where counts are not kept: their counts stay in the cache."""


def decisions_per_tick(config: ReadoutConfig) -> int:
    """Return how often a free taxel decides between two samples."""
    return config.clocks_per_sample if config.decide_every == "clock" else 1


# -- encoders ----------------------------------------------------------------------------------------


def encode(config: ReadoutConfig, samples: Samples, out: Counts | None = None) -> Counts:
    """Return the events that follow each sample.

    Parameters
    ----------
    config : ReadoutConfig
        Encoder and its parameters.
    samples : integer array, shape (ticks, taxels)
        Codes of W bits. int16 in C order (W <= 16) is read in place; other types are converted.
        LCS and CW-LCS take any number of taxels; N-LCS, whose leak depends on the row, ``config.taxels``.
    out : array of the result's shape and type, optional
        Where to write the result, to spare a new array.

    Returns
    -------
    int16 array, shape (ticks, taxels)
        Signed number of events; int32 only where one sample can cause more than 32,767 of them.

    Raises
    ------
    InputError
        If the samples have the wrong shape, type or range.

    Examples
    --------
    A step of 16 codes (N = 6, W = 12); the signal rises by three levels, rests, and falls by five:

    >>> import numpy as np
    >>> from model.config import ReadoutConfig
    >>> config = ReadoutConfig(rows=1, columns=1, resolution=6)
    >>> counts = encode(config, np.array([[0], [50], [49], [-40]]))
    >>> counts.ravel()
    array([ 0,  3,  0, -5], dtype=int16)
    >>> decode(config, counts).ravel()
    array([  0.,  48.,  48., -32.])
    """
    samples = _check_samples(config, samples)
    counts: Counts = np.empty(samples.shape, _count_dtype(config)) if out is None else out
    if counts.shape != samples.shape or counts.dtype != _count_dtype(config):
        raise InputError(
            f"out must be of shape {samples.shape} and type {np.dtype(_count_dtype(config))}, "
            f"not {counts.shape} and {counts.dtype}"
        )
    _Bank.reset(config, samples.shape[1]).run(samples, counts, None)
    return counts


def encode_timed(config: ReadoutConfig, samples: Samples) -> tuple[Counts, Flags]:
    """Return the events that follow each sample, and where they start a clock late.

    Parameters
    ----------
    config, samples
        As for ``encode``.

    Returns
    -------
    counts : int16 or int32 array, shape (ticks, taxels)
        As from ``encode``.
    late : bool array, shape (ticks, taxels)
        True where the first event falls in the second decision of the tick, since the window closed or the
        reference leaked in the first. Never true for LCS, nor with one decision per tick.
    """
    samples = _check_samples(config, samples)
    counts = np.empty(samples.shape, _count_dtype(config))
    late = np.zeros(samples.shape, np.bool_)
    _Bank.reset(config, samples.shape[1]).run(samples, counts, late)
    return counts, late


def count_events(config: ReadoutConfig, samples: Samples) -> NDArray[np.int64]:
    """Return the number of events of every taxel, shape (taxels,), without keeping the counts of each tick.

    Parameters
    ----------
    config, samples
        As for ``encode``.
    """
    samples = _check_samples(config, samples)
    ticks, taxels = samples.shape
    bank = _Bank.reset(config, taxels)
    totals = np.zeros(taxels, np.int64)
    block = max(1, min(_BLOCK_BYTES // max(1, taxels * samples.itemsize), 2**31 // _largest_count(config) - 1))
    counts = np.empty((min(block, ticks), taxels), _count_dtype(config))
    for start in range(0, ticks, block):
        part = samples[start : start + block]
        bank.run(part, counts[: len(part)], None)
        totals += kernels.magnitudes(counts[: len(part)])
    return totals


def encode_bipolar(config: ReadoutConfig, samples: Samples) -> Counts:
    """Return the signed events of the bipolar N-LCS that docs/results/classifier.md proposes; there is no RTL of it.

    The reference has a sign and leaks towards 0 by ``u <- u - ((u + 2**(k-1)) >> k)``. ON (+1) where x - u > D moves it
    up, OFF (-1) where x - u < -D moves it down, by D.

    Parameters
    ----------
    config : ReadoutConfig
        Of encoding nlcs.
    samples : integer array, shape (ticks, taxels)
        As for ``encode``.

    Returns
    -------
    int16 or int32 array, shape (ticks, taxels)
    """
    if config.encoding != "nlcs":
        raise InputError(f"the bipolar encoder is a leaky one, of encoding nlcs, not {config.encoding}")
    samples = _check_samples(config, samples)
    counts = np.empty(samples.shape, _count_dtype(config))
    kernels.bipolar(samples, np.zeros(samples.shape[1], np.int64), _leaky(config), counts)
    return counts


# -- address events ----------------------------------------------------------------------------------


def uncontended_events(config: ReadoutConfig, counts: Counts, late: Flags | None = None) -> Events:
    """Return the address events of all taxels as if each had a link of its own; exact for a one-taxel array.

    The j-th event (from 0) of tick i has ``t = i * clocks_per_sample + 3 + j``, one clock more where late.

    Parameters
    ----------
    config : ReadoutConfig
        Gives the addresses and the clocks per sample.
    counts, late : arrays, shape (ticks, config.taxels)
        From ``encode_timed``. ``late`` may be left out where it is never true.

    Returns
    -------
    ndarray of EVENT_DTYPE, shape (events,)
        Sorted by t, then by taxel index.
    """
    counts, delay = _check_counts(config, counts, late, needed=config.encoding != "lcs")
    if counts.shape[1] != config.taxels:
        raise InputError(f"counts must have one column for each of the {config.taxels} taxels, not {counts.shape[1]}")
    tick, taxel = np.nonzero(counts)
    signed = counts[tick, taxel].astype(np.int64)
    number = np.abs(signed)
    first = tick * config.clocks_per_sample + EVENT_LATENCY + delay[tick, taxel]
    nth = np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)
    t, taxel = np.repeat(first, number) + nth, np.repeat(taxel, number)
    order = np.lexsort((taxel, t))
    events = np.empty(len(t), EVENT_DTYPE)
    events["t"] = t[order]
    events["y"], events["x"] = np.divmod(taxel[order], config.columns)
    events["p"] = np.repeat(signed > 0, number)[order]
    return events


def counts_of_events(config: ReadoutConfig, events: Events, ticks: int) -> tuple[Counts, Flags]:
    """Return the counts and late flags of address events: the inverse of ``uncontended_events``.

    Events that had to wait for the link count for the tick in which they left, if that is one of ``ticks``.

    Parameters
    ----------
    config : ReadoutConfig
        Gives the addresses and the clocks per sample.
    events : ndarray of EVENT_DTYPE, shape (events,)
        In the order of their transfers.
    ticks : int
        Number of sample ticks.

    Returns
    -------
    counts, late : int32 and bool arrays, shape (ticks, config.taxels)
    """
    counts = np.zeros((ticks, config.taxels), np.int32)
    late = np.zeros((ticks, config.taxels), np.bool_)
    tick, delay = np.divmod(events["t"] - EVENT_LATENCY, config.clocks_per_sample)
    taxel = taxel_of(events, config)
    seen = (tick >= 0) & (tick < ticks)
    tick, delay, taxel = tick[seen], delay[seen], taxel[seen]
    np.add.at(counts, (tick, taxel), np.where(events["p"][seen], 1, -1))
    late[tick, taxel] = True
    late[tick[delay == 0], taxel[delay == 0]] = False
    return counts, late


# -- decoders ----------------------------------------------------------------------------------------


def decode(config: ReadoutConfig, counts: Counts, late: Flags | None = None) -> NDArray[np.float64]:
    """Return the reconstruction: the reference of the encoder at the end of every tick, exactly.

    LCS sums the events. No event moves the reference off the scale: one that seems to, since it came late, does
    nothing here either. CW-LCS rebuilds every window from the ticks without events, to know by how much an
    event moved the reference. N-LCS lets its copy of the reference leak as the encoder does.

    Parameters
    ----------
    config : ReadoutConfig
        The encoder.
    counts, late : arrays, shape (ticks, taxels)
        From ``encode_timed`` or ``counts_of_events``. ``late`` matters to CW-LCS deciding every clock only.

    Returns
    -------
    float64 array, shape (ticks, taxels)
        In codes; every value is exact. ``error_bound`` says how far the samples can be.
    """
    counts, delay = _check_counts(config, counts, late, needed=config.encoding == "cw-lcs")
    u = np.full(counts.shape[1], config.reference_reset, np.int64)
    reference = np.empty(counts.shape, np.float64)
    if config.encoding == "lcs":
        kernels.decode_lcs(counts, u, config.step, config.full_scale, reference)
    elif config.encoding == "cw-lcs":
        kernels.decode_cw_lcs(counts, delay, u, _closing(config), config.full_scale, reference)
    else:
        u <<= config.fraction_bits
        kernels.decode_nlcs(counts, u, _leaky(config), config.full_scale, 2.0**-config.fraction_bits, reference)
    return reference


def error_bound(config: ReadoutConfig) -> tuple[float, float]:
    """Return (low, high): low <= x - u <= high at the end of every tick, in codes, for inputs within a limit.

    The limit is ``slope_limit``, also for the step from the reference after reset to the first sample.

    - LCS: -D <= x - u < D.
    - CW-LCS: -D <= x - u < D; with several decisions per tick even -h <= x - u < h, h being the half-width.
    - N-LCS: x - u <= D, and a leak more where it decides only once per tick. No event follows a fall: there u
      stays below the leaky peak hold of x (it leaks as u does, and never lies below x). While x, from one
      decay tick to the next, falls by no more than the leak of its own level, that is within one leak of x.
      This low is returned; for other inputs it is minus full scale, and less for negative ones.
    """
    if config.encoding != "nlcs":
        return -config.step, config.step - 1
    leak = _largest_leak(config)
    return -leak, config.step + (leak if decisions_per_tick(config) == 1 else 0)


def slope_limit(config: ReadoutConfig) -> float:
    """Return the largest step between two samples, in codes, for which ``error_bound`` holds.

    D for every decision of a tick. Where there is only one it is less by a closing step, if windows close, or
    by the leak. N-LCS with several spends one on waiting for the leak, which it has to catch up as well; a
    negative limit means that the leak of a full-scale reference alone is too much for it.
    """
    decisions = decisions_per_tick(config)
    limit = float(config.step * decisions)
    if config.encoding == "cw-lcs" and decisions == 1 and config.closing_levels_log2:
        limit -= config.closing_step
    elif config.encoding == "nlcs":
        limit = config.step * max(decisions - 1, 1) - _largest_leak(config)
    return limit


def _largest_leak(config: ReadoutConfig) -> float:
    """Return the leak of a full-scale reference, in codes."""
    top = config.full_scale << config.fraction_bits
    return float(leak_of(top, config.leak_shift)) / 2**config.fraction_bits


# -- state and checks --------------------------------------------------------------------------------

_NO_FLAGS = np.zeros((0, 0), np.bool_)


@dataclass
class _Bank:
    """State of all taxels between two ticks.

    Attributes
    ----------
    u : shape (taxels,)
        Reference: in steps D (LCS), in closing steps (CW-LCS), in 2**-F codes (N-LCS).
    closed, quiet : shape (taxels,)
        CW-LCS: closing steps taken off the half-width, and ticks since the last one or the last event.
    tick : int
        Ticks since reset.
    """

    config: ReadoutConfig
    u: NDArray[Any]
    closed: NDArray[Any]
    quiet: NDArray[Any]
    tick: int = 0

    @classmethod
    def reset(cls, config: ReadoutConfig, taxels: int) -> _Bank:
        """Return the state after reset."""
        start = config.reference_reset // config.grid
        dtype: type[np.signedinteger[Any]] = np.int32
        if config.encoding == "nlcs":
            start <<= config.fraction_bits
        elif config.encoding == "lcs" and config.resolution <= 12:
            dtype = np.int16  # the cap of 2**(N + 2) steps takes N + 4 bits
        elif config.encoding == "cw-lcs" and _closing_fits(config):
            dtype = np.int16
        return cls(config, np.full(taxels, start, dtype), np.zeros(taxels, dtype), np.zeros(taxels, dtype))

    def run(self, x: NDArray[Any], counts: Counts, late: Flags | None) -> None:
        """Write the events of the samples x, shape (ticks, taxels), into counts and, if wanted, late."""
        c = self.config
        timed = late is not None
        flags = late if late is not None else _NO_FLAGS
        if c.encoding == "lcs":
            kernels.lcs(x, self.u, _log2(c.step), _largest_count(c), counts)
        elif c.encoding == "cw-lcs":
            state = kernels.TaxelState(self.u, self.closed, self.quiet)
            kernels.cw_lcs(x, state, _closing(c), counts, flags, timed)
        else:
            kernels.nlcs(x, self.u, self.tick, _leaky(c), counts, flags, timed)
        self.tick += len(x)


def _phases(config: ReadoutConfig) -> NDArray[np.int32]:
    """Return for every taxel the tick, modulo leak_period, at which it leaks, shape (taxels,)."""
    return np.repeat(decay_phases(config), config.columns).astype(np.int32)


def _closing(config: ReadoutConfig) -> kernels.ClosingRule:
    levels = config.closing_levels_log2
    return kernels.ClosingRule(_log2(config.closing_step), levels, config.window_period, _largest_count(config))


def _closing_fits(config: ReadoutConfig) -> bool:
    """Return whether 16 bits hold the state of CW-LCS; a difference of samples takes W + 1, less the closing step."""
    return config.sample_bits - _log2(config.closing_step) <= 15 and config.window_period <= np.iinfo(np.int16).max


def _leaky(config: ReadoutConfig) -> kernels.LeakyRule:
    leak = (_phases(config), config.leak_period, config.leak_shift, config.fraction_bits)
    return kernels.LeakyRule(*leak, _log2(config.step) + config.fraction_bits, _largest_count(config))


def _log2(power_of_two: int) -> int:
    return power_of_two.bit_length() - 1


def _largest_count(config: ReadoutConfig) -> int:
    """Return the largest number of events of one tick: all decisions, or the steps of the whole range."""
    return min(decisions_per_tick(config), 1 << (config.resolution + 2))


def _count_dtype(config: ReadoutConfig) -> type[np.signedinteger[Any]]:
    return np.int16 if _largest_count(config) <= np.iinfo(np.int16).max else np.int32


def _check_samples(config: ReadoutConfig, samples: Samples) -> NDArray[Any]:
    """Return the samples as a C-ordered int16 (W <= 16) or int32 array, or raise InputError."""
    samples = np.asarray(samples)
    if samples.ndim != 2:
        raise InputError(f"samples must have the shape (ticks, taxels), not {samples.shape}")
    if samples.dtype.kind not in "iu":
        raise InputError(f"samples must be integer codes, not {samples.dtype}; quantise them first")
    if config.encoding == "nlcs" and samples.shape[1] != config.taxels:
        raise InputError(
            f"samples must have one column for each of the {config.taxels} taxels, not {samples.shape[1]}, "
            f"since every row leaks at its own phase"
        )
    wanted = np.dtype(np.int16 if config.sample_bits <= 16 else np.int32)
    checked = np.ascontiguousarray(samples, dtype=wanted)
    narrowed = not np.can_cast(samples.dtype, wanted)
    if narrowed or kernels.magnitude_bits(checked.reshape(-1)) >= config.full_scale:
        low, high = -config.full_scale, config.full_scale - 1
        for worst in (int(samples.min(initial=0)), int(samples.max(initial=0))):
            if not low <= worst <= high:
                raise InputError(
                    f"samples must be in {low}..{high} ({config.sample_bits} bits), not {worst}; "
                    f"scale or clip them first"
                )
    return checked


def _check_counts(config: ReadoutConfig, counts: Counts, late: Flags | None, needed: bool) -> tuple[Counts, Flags]:
    """Return the counts and late flags, all false where not given and not needed, or raise InputError."""
    counts = np.asarray(counts)
    if counts.ndim != 2 or counts.dtype.kind != "i":
        raise InputError(
            f"counts must be signed integers of shape (ticks, taxels), not {counts.dtype} of {counts.shape}"
        )
    if config.encoding == "nlcs" and counts.shape[1] != config.taxels:
        raise InputError(f"counts must have one column for each of the {config.taxels} taxels, not {counts.shape[1]}")
    if late is None:
        if needed and decisions_per_tick(config) > 1:
            raise InputError(
                f"late must be given for {config.encoding} deciding more than once per sample; "
                "encode_timed returns it with the counts"
            )
        return counts, np.zeros(counts.shape, np.bool_)
    late = np.asarray(late)
    if late.shape != counts.shape or late.dtype != np.bool_:
        raise InputError(f"late must be a bool array of shape {counts.shape}, not {late.dtype} of {late.shape}")
    return counts, late
