"""Turn a column of time stamps or dates into seconds."""

from __future__ import annotations

import datetime
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.skin.recordings.options import Preparation

UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units of time stamps in seconds."""

NAME = re.compile(
    r"^\W*(t|times?|time[ _-]?stamps?|dates?|datetime|zeit|clock|secs?|seconds|millis|micros|nanos|ms|us|ns)"
    r"(?![a-z0-9])"
    r"|[ _]time([ _]?stamp)?$|^timestamp",
    re.IGNORECASE,
)
"""Names of time stamps; ``T1`` is the name of a taxel."""

_UNIT = re.compile(
    r"(?:^|[\s(\[_/])(s|sec|secs|seconds|ms|millis|msecs?|us|µs|micros|usecs?|ns|nanos)[\s)\]]*$", re.IGNORECASE
)
_UNIT_NAMES = {"sec": "s", "secs": "s", "seconds": "s", "millis": "ms", "msec": "ms", "msecs": "ms", "µs": "us"}
_UNIT_NAMES |= {"micros": "us", "usec": "us", "usecs": "us", "nanos": "ns"}

SAME_STAMP = 0.01
"""Part of the time stamps that may equal the previous one before the clock counts as coarse."""

WRAPS = (8, 16, 32)
"""Bits of counters that start again."""

RATES_HZ = (10.0, 20_000.0)
"""Usual sampling rates of skins, by which the unit of bare time stamps is known."""

CALENDAR = (
    datetime.datetime(2000, 1, 1, tzinfo=datetime.UTC).timestamp(),
    datetime.datetime(2100, 1, 1, tzinfo=datetime.UTC).timestamp(),
)
"""Seconds since 1970 between which a time stamp counts as a date."""


def unwrapped(stamps: NDArray[Any]) -> tuple[NDArray[Any], int]:
    """Return stamps without the restarts of a counter of ``WRAPS`` bits, and its bits; 0 without a restart."""
    steps = np.diff(stamps)
    if len(steps) < 2 or not (falls := steps < 0).any() or stamps.min() < 0:
        return stamps, 0
    usual = float(np.median(steps[~falls])) if (~falls).any() else 0.0
    for bits in WRAPS:
        again = steps[falls] + 2.0**bits
        if stamps.max() < 2**bits and usual > 0 and (again > 0).all() and (again <= max(50 * usual, usual + 2)).all():
            return stamps + np.concatenate([[0], np.cumsum(falls)]) * 2**bits, bits
    return stamps, 0


def seconds_of(
    path: Path, stamps: NDArray[Any], name: str, options: Preparation, rate_hz: float | None
) -> tuple[NDArray[np.float64], float, tuple[str, ...]]:
    """Return time stamps in seconds from the first, the first in seconds, and notes.

    - ``stamps``: whole numbers or floats, shape (samples,).
    - ``rate_hz``: sampling rate that the user gave; it tells the unit of bare numbers.

    Raise InputError if there are fewer than two, they fall, or their unit is unknown.
    """
    if len(stamps) < 2:
        raise InputError(f"{path} has only one sample; a recording needs at least two")
    stamps, bits = unwrapped(stamps)
    notes = [f"column {name!r} starts again after {bits} bits; its restarts are undone"] if bits else []
    steps = np.diff(stamps)
    if (steps < 0).any() or not (steps > 0).any():
        line = int(np.argmax(steps < 0 if (steps < 0).any() else steps == 0)) + 2
        raise InputError(
            f"{path}: the time stamp of sample {line} is not later than the previous time stamp; sort the samples, or "
            f"give --time-column none and --sample-rate HZ"
        )
    span = float(stamps[-1] - stamps[0])
    coarse = bool((steps == 0).mean() > SAME_STAMP)
    period = span / (len(stamps) - 1) if coarse else float(np.median(steps))
    unit, note = _unit(path, name, float(stamps[0]), steps, period, options, rate_hz)
    notes.append(note)
    scale = UNITS_S[unit]
    start = float(stamps[0]) * scale
    if coarse:
        largest, usual = float(steps.max()), float(np.median(steps[steps > 0]))
        if largest > 20 * usual:
            raise InputError(
                f"{path} repeats time stamps, and has a gap of {largest * scale:.4g} s; cut it into two recordings, or "
                f"give --time-column none and --sample-rate HZ"
            )
        seconds = np.linspace(0.0, span * scale, len(stamps))
        notes.append(
            f"column {name!r} repeats its stamps: the samples are evenly spaced between the first and the last, "
            f"{1 / (period * scale):.4g} samples/s; --time-column none --sample-rate HZ gives another rate"
        )
        return seconds, start, tuple(notes)
    return np.asarray((stamps - stamps[0]) * scale, np.float64), start, tuple(notes)


def _unit(
    path: Path, name: str, first: float, steps: NDArray[Any], period: float, options: Preparation, rate_hz: float | None
) -> tuple[str, str]:
    """Return the unit of time stamps, and a note on how it is known."""
    change = "--time-unit gives another unit"
    if options.time_unit != "auto":
        return options.time_unit, f"time stamps are in {options.time_unit}"
    dated = [unit for unit, scale in UNITS_S.items() if CALENDAR[0] <= first * scale < CALENDAR[1]]
    if found := _UNIT.search(name):
        unit = _UNIT_NAMES.get(found[1].lower(), found[1].lower())
        if not dated or unit in dated or rate_hz is None:
            return unit, f"time stamps are in {unit}, by the name of the column; {change}"
    if (steps == 1).all() and not dated and rate_hz is None:
        raise InputError(f"{path}: the time stamps rise by one; give their unit with --time-unit s, ms, us or ns")
    if dated:
        day = datetime.datetime.fromtimestamp(first * UNITS_S[dated[0]], datetime.UTC)
        return dated[0], f"time stamps are in {dated[0]} since 1970, {day:%Y-%m-%d}; {change}"
    if rate_hz is not None:
        fits = [unit for unit, scale in UNITS_S.items() if 0.5 < period * scale * rate_hz < 2]
        if fits:
            return fits[0], f"time stamps are in {fits[0]}, by the sampling rate; {change}"
    usual = [unit for unit, scale in UNITS_S.items() if RATES_HZ[0] <= 1 / (period * scale) <= RATES_HZ[1]]
    if len(usual) != 1 and period >= 1:
        rates = " or ".join(f"{1 / (period * scale):.4g} samples/s in {unit}" for unit, scale in UNITS_S.items())
        raise InputError(
            f"{path}: the time stamps rise by {period:g} without a unit: {rates}; give --time-unit, or --sample-rate HZ"
        )
    unit = usual[0] if len(usual) == 1 else "s"
    return unit, f"time stamps are in {unit}, by their steps: {1 / (period * UNITS_S[unit]):.4g} samples/s; {change}"


def dates_of(cells: Any) -> NDArray[np.int64] | None:
    """Return the nanoseconds since 1970 of dates or times of day that pandas reads; None for other text."""
    import warnings

    import pandas

    if pandas.api.types.is_datetime64_any_dtype(cells):
        stamps = pandas.to_datetime(cells, utc=True)
    else:
        text = cells.astype(str).str.strip().str.strip('"')
        if not text.head(5).str.contains(r"\d[:/\-.]\d", regex=True).all():
            return None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if text.head(5).str.fullmatch(r"\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?").all():  # a clock without a date
                stamps = pandas.to_timedelta(
                    text.str.replace(",", ".").str.replace(r"^(\d{1,2}:\d{2})$", r"00:\1", regex=True), errors="coerce"
                )
                if stamps.isna().any():
                    return None
                clock = stamps.to_numpy("timedelta64[ns]").astype(np.int64)
                days = np.concatenate([[0], np.cumsum(np.diff(clock) < -12 * 3600 * 10**9)])
                return np.asarray(clock + days * 86_400 * 10**9)
            stamps = None
            for form in ("ISO8601", None, "mixed"):
                stamps = pandas.to_datetime(text, errors="coerce", utc=True, format=form, dayfirst=False)
                if not stamps.isna().any():
                    break
    if stamps.isna().any():
        return None
    return np.asarray(stamps.dt.as_unit("ns").astype("int64").to_numpy())
