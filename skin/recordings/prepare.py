"""Convert sensor recordings to codes: resample, remove the baseline, and scale all recordings equally."""

import dataclasses
import math
import statistics
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.skin.recordings.options import PER_TAXEL, Preparation, Scale
from eskin.skin.recordings.table import Table, Values, rises
from eskin.skin.textures.presets import quantise

JITTER = 0.02  # part of a sample period by which time stamps may miss the grid before a recording is resampled
OWN_CLOCK = 0.01  # relative difference from the common rate up to which the samples of a recording count as even
MISSING = 1.5  # sample periods between two time stamps from which on samples are missing between them
LOW_PERCENTILE = 1.0  # percentile of a taxel's samples that is its fixed offset: the lowest value without outliers
MUCH_CLIPPED = 1e-3  # part of the samples above which clipping is worth a warning


@dataclass(frozen=True, eq=False)
class Prepared:
    """Recordings as codes, in the order of their tables."""

    codes: list[NDArray[np.int32]]  # shape (ticks, taxels)
    rate_hz: float  # samples per second of all
    scale: Scale
    options: Preparation  # with the offsets of a fixed baseline
    clipped: int  # samples beyond full scale, all together
    warnings: tuple[str, ...]  # each with the option that fixes the problem
    notes: tuple[str, ...]  # changes of the samples

    def levels(self, sample_bits: int) -> NDArray[np.float64]:
        """Return the fixed offset of each taxel in codes, shape (taxels,); zeros for another baseline."""
        return levels_of(self.options, self.scale, sample_bits, self.codes[0].shape[1])


def prepare(
    tables: Sequence[Table],
    options: Preparation,
    sample_bits: int,
    rate_hz: float | None = None,
    learned: Collection[int] | None = None,
) -> Prepared:
    """Return recordings as codes, with one sampling rate and one scale.

    - ``rate_hz``: by default the rate of the time stamps, median of all recordings.
    - ``learned``: numbers of the recordings that determine scale and fixed offsets, also at the gains; all by default.

    Raise InputError if no rate is known, or the recordings have different numbers of taxels, or another number than the
    factors.
    """
    widths = {table.values.shape[1]: table.path for table in tables}
    if len(widths) > 1:
        (a, first), (b, second) = list(widths.items())[:2]
        raise InputError(f"{first} has {a} taxels, {second} has {b}; choose the same taxels with --taxel-columns")
    rate_hz = rate_hz or common_rate(tables)
    warnings = _columns_that_are_no_signal(tables)
    signals, resampled = [], 0
    for table in tables:
        signal, moved = on_grid(table, rate_hz)
        resampled += moved
        signals.append(signal)
    numbers = range(len(signals)) if learned is None else learned
    at_gains = [signals[number] * gain for gain in options.gains for number in numbers]
    if options.baseline == "fixed" and not options.offsets:
        used = [signals[number] for number in numbers]
        options = dataclasses.replace(options, offsets=fixed_offsets([*used, *at_gains]))
    signals, at_gains = (
        [without_baseline(signal, rate_hz, options) for signal in some] for some in (signals, at_gains)
    )
    notes = _filled(tables)
    if resampled:
        notes.append(f"{resampled} of {len(tables)} recordings have uneven time stamps and were resampled linearly")
    scale = scale_of([*(signals[number] for number in numbers), *at_gains], options, sample_bits)
    if isinstance(scale, tuple) and len(scale) != len(tables[0].names):
        raise InputError(
            f"{tables[0].path} has {len(tables[0].names)} taxels, but the scale has {len(scale)} factors; choose the "
            f"same taxels with --taxel-columns, or give --scale one factor for each"
        )
    with np.errstate(over="ignore"):  # overflows saturate, like all values out of range
        found = [quantise(signal * np.asarray(scale), sample_bits) for signal in signals]
    clipped, samples = sum(n for _, n in found), sum(codes.size for codes, _ in found)
    if clipped > MUCH_CLIPPED * samples:
        remedy = "--scale max" if options.baseline != "none" else "--baseline first, or --scale max"
        warnings.append(f"{clipped / samples:.1%} of the samples are beyond full scale and clipped; try {remedy}")
    warnings += _baseline_left(found, options, sample_bits)
    return Prepared([codes for codes, _ in found], rate_hz, scale, options, clipped, tuple(warnings), tuple(notes))


def common_rate(tables: Sequence[Table]) -> float:
    """Return the median sampling rate of recordings; raise InputError if a rate is missing or very different.

    A rate is very different if it is at least twice the median, or at most half the median.
    """
    rates = []
    for table in tables:
        if table.time_s is not None:
            steps = np.diff(table.time_s)  # mean of the steps without gaps: jitter does not change it
            rates.append(1 / float(steps[steps < MISSING * np.median(steps)].mean()))
        elif table.rate_hz is not None:
            rates.append(table.rate_hz)
        else:
            raise InputError(f"{table.path} contains no sampling rate; add --sample-rate HZ")
    rate = float(f"{statistics.median(rates):.4g}")
    furthest = max(range(len(rates)), key=lambda k: abs(np.log(rates[k] / rate)))
    if not 0.5 < rates[furthest] / rate < 2:
        raise InputError(
            f"{tables[furthest].path} has {rates[furthest]:.4g} samples/s, but the others have {rate:.4g}; "
            f"give the rate of all with --sample-rate HZ, or --time-unit"
        )
    return rate


def on_grid(table: Table, rate_hz: float) -> tuple[Values, bool]:
    """Return the signals of a recording at a constant rate, and whether they were resampled.

    Samples are even where their time stamps miss an even grid by no more than ``JITTER``, or by no more than the
    rounding of the stamps, as milliseconds of a sensor at 36 Hz do. The grid may run with the recording's own clock.
    """
    time_s = table.time_s
    if time_s is None:
        return table.values, False
    period, own = 1 / rate_hz, float(time_s[-1]) / (len(time_s) - 1)
    steps = np.diff(time_s)
    finest = float(np.diff(np.unique(np.round(steps, 9))).min(initial=math.inf)) if np.ptp(steps) > 1e-9 else 0.0
    allowed = max(JITTER * period, min(1.5 * finest, 0.1 * period))  # the finest difference is a unit of the stamps
    if abs(own / period - 1) <= OWN_CLOCK and np.abs(time_s - np.arange(len(time_s)) * own).max() <= allowed:
        return table.values, False
    if (gap := float(steps.max())) > 1000 * period:
        raise InputError(f"{table.path} has a gap of {gap:.4g} s in its time stamps; cut it into two recordings")
    grid = np.arange(int(time_s[-1] * rate_hz + 1e-6) + 1) * period
    return np.stack([np.interp(grid, time_s, column) for column in table.values.T], axis=1), True


def _filled(tables: Sequence[Table]) -> list[str]:
    rows, holed, cells = 0, 0, sum(table.filled for table in tables)
    for table in tables:
        if table.time_s is not None:
            steps = np.diff(table.time_s)
            periods = steps / np.median(steps[steps > 0])
            missing = int(np.rint(periods[periods > MISSING] - 1).sum())
            rows, holed = rows + missing, holed + bool(missing)
    notes = []
    if rows:
        notes.append(f"{rows} samples are missing in the time stamps of {holed} recordings: filled in, linearly")
    if cells:
        files = sum(table.filled > 0 for table in tables)
        notes.append(f"{cells} cells of {files} recordings hold no number: filled in, linearly")
    return notes


def fixed_offsets(signals: Sequence[Values]) -> tuple[float, ...]:
    """Return the offset of each taxel that keeps its level: nearly the lowest value of all recordings."""
    return tuple(np.percentile(np.concatenate(signals), LOW_PERCENTILE, axis=0).tolist())


def levels_of(options: Preparation, scale: Scale, sample_bits: int, taxels: int) -> NDArray[np.float64]:
    """Return the fixed offset of each taxel in codes, shape (taxels,); zeros for another baseline."""
    offsets = options.offsets if options.baseline == "fixed" else (0.0,) * taxels
    return np.asarray(offsets) * np.asarray(scale) * 2 ** (sample_bits - 1)


def at_gain(codes: NDArray[np.int32], gain: float, levels: NDArray[np.float64], sample_bits: int) -> NDArray[np.int32]:
    """Return a recording as codes as if the signals, before the baseline was removed, were larger by a gain.

    ``levels``: fixed offset of each taxel in codes, which stays as it is. The other baselines are linear.
    """
    full_scale = 2 ** (sample_bits - 1)
    return np.clip(np.rint(codes * gain + levels * (gain - 1)), -full_scale, full_scale - 1).astype(np.int32)


def without_baseline(signal: Values, rate_hz: float, options: Preparation) -> Values:
    """Return a recording with the baseline of each taxel removed, shape (ticks, taxels)."""
    if options.baseline == "fixed":
        if len(options.offsets) != signal.shape[1]:
            raise InputError(
                f"the fixed baseline has {len(options.offsets)} offsets, but the recording has {signal.shape[1]} taxels"
            )
        return np.asarray(signal - options.offsets)
    if options.baseline == "first":
        return np.asarray(signal - signal[0])
    if options.baseline == "median":
        return np.asarray(signal - np.median(signal, axis=0))
    if options.baseline == "highpass":
        from scipy.signal import butter, lfilter

        if options.highpass_hz >= rate_hz / 2:
            raise InputError(f"--highpass must be below half of {rate_hz:g} samples/s, not {options.highpass_hz:g}")
        numerator, denominator = butter(1, options.highpass_hz, "highpass", fs=rate_hz)
        return np.asarray(lfilter(numerator, denominator, signal - signal[0], axis=0))  # starts at rest
    return signal


def scale_of(signals: Sequence[Values], options: Preparation, sample_bits: int) -> Scale:
    """Return the factor that scales all recordings to full scale, or the factor of each taxel.

    Where factors are of each taxel, a taxel that is always 0 has the factor of the taxel with the largest magnitude.
    """
    percentile = options.percentile()
    if percentile is None:
        return options.factors()
    magnitudes = np.concatenate([np.abs(signal) for signal in signals])
    largest = 1.0 - 2.0 ** (1 - sample_bits)  # the positive end of the range is one code short of full scale
    if options.scale == PER_TAXEL and magnitudes.shape[1] > 1 and (tops := magnitudes.max(0)).max() > 0:
        return tuple((largest / np.where(tops > 0, tops, tops.max())).tolist())
    top = float(np.percentile(magnitudes, percentile))
    return largest / top if top > 0 else 1.0


# -- warnings ----------------------------------------------------------------------------------------


def _columns_that_are_no_signal(tables: Sequence[Table]) -> list[str]:
    """Return a warning about columns that never change, or that rise in every recording."""
    warnings = []
    for marks, what, remedy in (
        (lambda column: np.ptp(column) == 0, "never changes", "leave it out with --taxel-columns"),
        (rises, "rises steadily", "if it is time or a counter, name it with --time-column, or leave it out"),
    ):
        found = [name for k, name in enumerate(tables[0].names) if all(marks(table.values[:, k]) for table in tables)]
        if found:
            more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
            warnings.append(f"column {found[0]!r}{more} {what}; {remedy}")
    return warnings


def _baseline_left(found: Sequence[tuple[NDArray[np.int32], int]], options: Preparation, sample_bits: int) -> list[str]:
    """Return a warning if small signals on a large baseline use little of the full scale."""
    moved = max(int(np.ptp(codes, axis=0).max()) for codes, _ in found)
    largest = max(int(np.abs(codes).max()) for codes, _ in found)
    if options.baseline == "none" and largest > 4 * moved and largest > 2 ** (sample_bits - 4):
        return [
            f"the signals have a baseline and use {moved / 2 ** (sample_bits - 1):.1%} of full scale; "
            f"subtract the baseline with --baseline first, median or highpass"
        ]
    return []
