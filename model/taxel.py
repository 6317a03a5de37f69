"""Functional model: encode and decode taxel signals without contention (docs/reference/encoders.md).

A request is taken in the clock after it was raised, as with one taxel and a sink that is always ready. The model starts
with the first sample. If the reset value of the reference is far enough from 0 to cause events before the first sample,
these events are not modelled.

A tick is a sample tick; its first decision is in the clock after ``sample_valid``. The kernels compute all decisions of
a tick at once, in closed form.

All events of one tick have the same sign, and follow each other clock by clock. An event moves the reference to a level
between itself and the sample, never beyond. ON needs x - u >= h and leaves x - u >= 0, so no OFF (x - u < -h) can
follow. OFF needs x - u < -h and leaves x - u < 0, so no ON (x - u >= h > 0) can follow. A sample on the scale therefore
never moves the reference off the scale. Only the first event may come late, in the second decision of the tick, if a
window closed or a reference leaked in the first decision. ``encode_timed`` marks these ticks.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model import taxel_kernels as kernels
from eskin.model.address_events import Events, make_events, taxel_of
from eskin.model.config import ReadoutConfig
from eskin.model.decay import decay_phases
from eskin.model.encoders.fields import is_off, signals

Samples = NDArray[np.integer[Any]]
"""Codes of W bits, shape (ticks, taxels)."""

Counts = NDArray[np.signedinteger[Any]]
"""Signed events after each sample, shape (ticks, taxels): +n is n ON events, -n is n OFF events."""

Flags = NDArray[np.bool_]
"""One flag for each sample, shape (ticks, taxels)."""

EVENT_LATENCY = 3
"""Clocks from ``sample_valid`` to the first event that it causes (docs/design/microarchitecture.md, Time)."""

_BLOCK_BYTES = 2**20
"""Bytes of samples per block if the counts are only added up: the counts of a block stay in the cache."""


# -- encoders ----------------------------------------------------------------------------------------


def encode(config: ReadoutConfig, samples: Samples, out: Counts | None = None) -> Counts:
    """Return the event counts of each sample for every taxel.

    The counts, shape (ticks, taxels), are signed int16; int32 only where one sample can cause more than 32,767 events.

    - ``samples``: codes of W bits, shape (ticks, taxels). int16 in C order (W <= 16) is read in place; other types are
      converted. LCS and CW-LCS accept any number of taxels. N-LCS needs ``config.taxels``, because its leak depends on
      the row, and so do receptive fields, which are applied to the samples.
    - ``out``: array for the result, to avoid a new one. Its content is undefined after an error.

    Examples
    --------
    A step of 16 codes (N = 6, W = 12); the signal rises by three levels, rests, and falls by five:

    >>> import numpy as np
    >>> from eskin.model.config import ReadoutConfig
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
    _run(config, samples, _reset(config, samples.shape[1]), 0, counts, _NO_FLAGS)
    return _silenced(config, counts)


def encode_timed(config: ReadoutConfig, samples: Samples) -> tuple[Counts, Flags]:
    """Return the event counts as ``encode`` does, and bool flags of the same shape for events that start late.

    A flag is true if the first event is in the second decision of the tick, because the window closed or the reference
    leaked in the first. It is never true for LCS, nor with one decision per tick.
    """
    samples = _check_samples(config, samples)
    counts = np.empty(samples.shape, _count_dtype(config))
    late = np.zeros(samples.shape, np.bool_)
    _run(config, samples, _reset(config, samples.shape[1]), 0, counts, late)
    return _silenced(config, counts), _silenced(config, late)


def count_events(config: ReadoutConfig, samples: Samples) -> NDArray[np.int64]:
    """Return the total number of events of every taxel, shape (taxels,), for samples as in ``encode``."""
    samples = _check_samples(config, samples)
    ticks, taxels = samples.shape
    state = _reset(config, taxels)
    totals = np.zeros(taxels, np.int64)
    block = max(1, min(_BLOCK_BYTES // max(1, taxels * samples.itemsize), 2**31 // config.most_events_per_tick - 1))
    counts = np.empty((min(block, ticks), taxels), _count_dtype(config))
    for start in range(0, ticks, block):
        part = samples[start : start + block]
        _run(config, part, state, start, counts[: len(part)], _NO_FLAGS)
        totals += kernels.magnitudes(counts[: len(part)])
    return _silenced(config, totals)


# -- address events ----------------------------------------------------------------------------------


def uncontended_events(config: ReadoutConfig, counts: Counts, late: Flags | None = None) -> Events:
    """Return the address events of all taxels as if each had its own link.

    The j-th event (from 0) of tick i has ``t = i * clocks_per_sample + 3 + j``, one clock more where late.

    ``counts`` and ``late``, shape (ticks, config.taxels), are the result of ``encode_timed``. ``late`` may be omitted
    if it is never true. The events are sorted by t, then by taxel index.
    """
    counts, delay = _check_counts(config, counts, late, needed=config.encoder.late)
    if counts.shape[1] != config.taxels:
        raise InputError(f"counts must have one column for each of the {config.taxels} taxels, not {counts.shape[1]}")
    tick, taxel = np.nonzero(counts)
    signed = counts[tick, taxel].astype(np.int64)
    number = np.abs(signed)
    first = tick * config.clocks_per_sample + EVENT_LATENCY + delay[tick, taxel]
    nth = np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)
    t, taxel = np.repeat(first, number) + nth, np.repeat(taxel, number)
    order = np.lexsort((taxel, t))
    return make_events(t[order], *np.divmod(taxel[order], config.columns), np.repeat(signed > 0, number)[order])


def counts_of_events(config: ReadoutConfig, events: Events, ticks: int) -> tuple[Counts, Flags]:
    """Return the counts and late flags of address events, the inverse of ``uncontended_events``.

    Events that had to wait for the link count for the tick in which they left, if that is one of ``ticks``. The arrays
    have the shape (ticks, config.taxels).
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
    """Return the reconstruction: the reference of every taxel at the end of every tick.

    No event moves the reference off the scale: a late event that would do so has no effect.

    ``counts`` and ``late``, shape (ticks, taxels), are the result of ``encode_timed`` or ``counts_of_events``. ``late``
    only matters for an encoder with ``timed`` that decides every clock. The reconstruction has the same shape, in
    codes, and is exact: ``error_bound`` limits its distance to the samples.
    """
    encoder = config.encoder
    counts, delay = _check_counts(config, counts, late, needed=encoder.timed)
    parameters = kernels.Parameters.of(config)
    taxels = np.zeros(counts.shape[1], kernels.taxel_dtype(config))
    taxels["u"] = parameters.reset
    reference = np.empty(counts.shape, np.float64)
    unit = 2.0 ** -encoder.fraction_bits(config)
    kernels.decode(parameters, taxels, counts, delay, _phases(config), unit, reference)
    return reference


def error_bound(config: ReadoutConfig) -> tuple[float, float]:
    """Return the error bounds (low, high): low <= x - u <= high in codes, for signals within the slope limit.

    The limit is ``slope_limit``, which also applies to the step from the reset value of the reference to the first
    sample. ``error_bound`` of each encoder (``eskin.model.encoders``) defines its bound.
    """
    return config.encoder.error_bound(config)


def slope_limit(config: ReadoutConfig) -> float:
    """Return the largest step between two samples, in codes, for which ``error_bound`` holds."""
    return config.encoder.slope_limit(config)


# -- state and checks --------------------------------------------------------------------------------

_NO_FLAGS = np.zeros((0, 0), np.bool_)


def _reset(config: ReadoutConfig, taxels: int) -> tuple[NDArray[Any], ...]:
    """Return the state of all taxels after reset, as for ``Encoder.ticks``."""
    encoder = config.encoder
    start = config.reference_reset // config.grid << encoder.fraction_bits(config)
    starts = (start, *(0 for _ in encoder.state))
    return tuple(np.full(taxels, value, encoder.state_dtype(config)) for value in starts)


def _run(
    config: ReadoutConfig, x: NDArray[Any], state: tuple[NDArray[Any], ...], tick: int, counts: Counts, late: Flags
) -> None:
    """Write counts from a tick on and, if ``late`` has room, flags; then check the range of the samples."""
    rule, timed = config.encoder.rule(config), late is not _NO_FLAGS
    seen = kernels.ticks(rule, x, state, _phases(config), tick, counts, late, timed)
    if seen >= config.full_scale:
        _refuse_range(config, x)


def _phases(config: ReadoutConfig) -> NDArray[np.int32]:
    """Return the leak phase of every taxel: its decay tick modulo leak_period."""
    return np.repeat(decay_phases(config), config.columns).astype(np.int32)


def _count_dtype(config: ReadoutConfig) -> type[np.signedinteger[Any]]:
    return np.int16 if config.most_events_per_tick <= np.iinfo(np.int16).max else np.int32


def _check_samples(config: ReadoutConfig, samples: Samples) -> NDArray[Any]:
    """Return samples after the receptive fields, as a C-ordered integer array.

    ``_run`` checks the range of samples that pass through unchanged.
    """
    samples = np.asarray(samples)
    if samples.ndim != 2:
        raise InputError(f"samples must have the shape (ticks, taxels), not {samples.shape}")
    if samples.dtype.kind not in "iu":
        raise InputError(
            f"samples must be integer codes, not {samples.dtype}; eskin.encode takes floats in full scales"
        )
    for needs_all, reason in (
        (config.encoder.leaks, "every row leaks at its own phase"),
        (config.receptive_fields != "own", "receptive fields add samples of the array"),
    ):
        if needs_all and samples.shape[1] != config.taxels:
            raise InputError(
                f"samples must have one column for each of the {config.taxels} taxels, not {samples.shape[1]}, "
                f"since {reason}"
            )
    wanted = np.dtype(np.int16 if config.sample_bits <= 16 else np.int32)
    checked = np.ascontiguousarray(samples, dtype=wanted)
    if not np.can_cast(samples.dtype, wanted) or config.receptive_fields != "own":
        _refuse_range(config, samples)
    return signals(config, checked)


def _refuse_range(config: ReadoutConfig, samples: NDArray[Any]) -> None:
    low, high = -config.full_scale, config.full_scale - 1
    for worst in (int(samples.min(initial=0)), int(samples.max(initial=0))):
        if not low <= worst <= high:
            raise InputError(
                f"samples must be in {low}..{high} ({config.sample_bits} bits), not {worst}; scale or clip them first"
            )


def _silenced(config: ReadoutConfig, found: NDArray[Any]) -> NDArray[Any]:
    """Return counts or flags with 0 for every taxel whose receptive field is off."""
    if not isinstance(config.receptive_fields, str):
        found[..., is_off(config)] = 0
    return found


def _check_counts(config: ReadoutConfig, counts: Counts, late: Flags | None, needed: bool) -> tuple[Counts, Flags]:
    counts = np.asarray(counts)
    if counts.ndim != 2 or counts.dtype.kind != "i":
        raise InputError(
            f"counts must be signed integers of shape (ticks, taxels), not {counts.dtype} of {counts.shape}"
        )
    if config.encoder.leaks and counts.shape[1] != config.taxels:
        raise InputError(f"counts must have one column for each of the {config.taxels} taxels, not {counts.shape[1]}")
    if late is None:
        if needed and config.decisions_per_tick > 1:
            raise InputError(
                f"late is required for {config.encoding} with several decisions per sample; "
                "encode_timed returns it with the counts"
            )
        return counts, np.zeros(counts.shape, np.bool_)
    late = np.asarray(late)
    if late.shape != counts.shape or late.dtype != np.bool_:
        raise InputError(f"late must be a bool array of shape {counts.shape}, not {late.dtype} of {late.shape}")
    return counts, late
