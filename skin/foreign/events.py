"""Convert events of other programs to recordings."""

import dataclasses
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.address_events import Events, make_events
from eskin.model.config import MAX_SIDE, ReadoutConfig
from eskin.model.events.recording import MAX_CLOCKS, Recording
from eskin.skin.foreign.address_map import Addresses, AddressMap

UNITS_S = {"s": Fraction(1), "ms": Fraction(1, 10**3), "us": Fraction(1, 10**6), "ns": Fraction(1, 10**9)}
"""Units of time stamps in seconds."""

CLOCKS = "clocks"  # name of the unit of time stamps that count clocks of the readout

LATE_S = 86_400  # time in seconds; a later first event has the time of a wall clock, not of a recording


@dataclass(frozen=True, eq=False)
class ForeignEvents:
    """Events with the columns and the time unit of their file."""

    time: NDArray[Any]  # in ``unit``, shape (events,)
    unit: str  # one of UNITS_S, or ``clocks``
    addresses: Addresses  # single addresses, or columns and rows, shape (events,) or (events, 2)
    polarity: NDArray[np.bool_]  # True is ON, shape (events,)
    size: tuple[int, int] | None = None  # rows and columns of the sensor, if the file contains them
    notes: tuple[str, ...] = ()  # notes for the user on the interpretation of the file


def unwrapped(events: ForeignEvents, bits: int) -> ForeignEvents:
    """Return events after removing the overflows of a time counter of ``bits`` bits."""
    if not 1 <= bits <= 62:
        raise InputError(f"--wrap takes 1 to 62 bits, not {bits}")
    if events.time.dtype.kind != "i":
        raise InputError("--wrap is for whole time stamps; these have a point, so leave it out")
    if len(events.time) and not 0 <= int(events.time.min()) <= int(events.time.max()) < 2**bits:
        raise InputError(f"time stamps reach {events.time.max()}, beyond a counter of {bits} bits; correct --wrap")
    steps = np.diff(events.time, prepend=events.time[:1])
    wraps = np.cumsum(steps < -(2 ** (bits - 1)))
    note = f"{int(wraps[-1]) if len(wraps) else 0} wraps of the {bits}-bit time stamps undone"
    return dataclasses.replace(events, time=events.time + (wraps << bits), notes=(*events.notes, note))


def in_order(events: ForeignEvents) -> ForeignEvents:
    """Return events sorted by time (stable)."""
    order = np.argsort(events.time, kind="stable")
    return dataclasses.replace(
        events, time=events.time[order], addresses=events.addresses[order], polarity=events.polarity[order]
    )


def configuration(
    events: ForeignEvents, config: ReadoutConfig, given: frozenset[str], mapping: AddressMap | None
) -> ReadoutConfig:
    """Return the configuration; take a missing array size from the events or their map.

    ``given`` names the fields that the user set. The clock is 1 MHz unless sample rate or clocks per sample are given.
    """
    if mapping is not None:
        rows, columns = mapping.size
    elif events.size is not None:
        rows, columns = events.size
    elif events.addresses.ndim == 1:
        raise InputError("the events have one address each; give the taxel of each address with --map FILE")
    elif not len(events.addresses):
        rows, columns = config.rows, config.columns
    else:
        columns, rows = (max(1, int(most) + 1) for most in events.addresses.max(axis=0))
    if max(rows, columns) > MAX_SIDE and not {"rows", "columns"} <= given:
        raise InputError(
            f"the sensor has {rows} x {columns} addresses, but a readout has at most {MAX_SIDE} x {MAX_SIDE}; "
            f"name the taxels with --map FILE"
        )
    found: dict[str, Any] = {"rows": rows, "columns": columns}
    if not given & {"sample_rate_hz", "clocks_per_sample"}:
        found |= {"sample_rate_hz": 1000.0, "clocks_per_sample": 1000}
    return config.replace(**{name: value for name, value in found.items() if name not in given})


@dataclass(frozen=True)
class Taken:
    """A recording converted from foreign events, with counts of dropped or changed events."""

    recording: Recording
    dropped: int  # events without a taxel
    moved: int  # number of events with a time between two clocks
    merged: int  # number of events with different times that now share a clock
    start: float  # time of clock 0 in the unit of the file

    def said(self) -> list[str]:
        """Return a sentence for every kind of loss in the conversion."""
        found = [f"clock 0 is time {self.start} of the file"] if self.start else []
        if self.dropped:
            found.append(f"{self.dropped} events without a taxel were left out")
        if self.moved:
            clock = f"{self.recording.clock_hz:g} Hz"
            found.append(f"{self.moved} events were moved to the nearest clock of {clock}; {self.merged} share one now")
        return found


def take(
    events: ForeignEvents,
    config: ReadoutConfig,
    mapping: AddressMap | None = None,
    drop: bool = False,
    start: float | None = None,
    metadata: dict[str, Any] | None = None,
) -> Taken:
    """Return the recording converted from foreign events.

    Raise InputError if time falls, or addresses do not fit the readout.

    - ``events``: in order of time.
    - ``config``: configuration of the recording; its clock is the resolution of time.
    - ``mapping``: without a map, addresses are columns and rows from 0.
    - ``drop``: leave out events whose address is not mapped.
    - ``start``: time, in the unit of the file, that becomes clock 0. By default 0, or the first event if that is
      negative. It must be given if the first event is more than a day after 0.
    """
    time = events.time
    if time.dtype.kind == "f" and not np.isfinite(time).all():
        raise InputError(f"event {int(np.flatnonzero(~np.isfinite(time))[0])} has no finite time; remove it")
    if falls := np.flatnonzero(np.diff(time) < 0).tolist():
        at = falls[0] + 1
        raise InputError(
            f"event {at} has time {time[at]}, earlier than the previous time {time[at - 1]}; if a counter of N bits "
            f"starts again, give --wrap N, otherwise --sort"
        )
    if start is None:
        start = time[0].item() if len(time) and time[0] < 0 else 0
        if len(time) and float(time[0]) * float(_seconds(events.unit, config)) > LATE_S:
            raise InputError(
                f"the first event is at time {time[0]}, more than a day after 0; give the time that becomes clock 0 "
                f"with --start {time[0]}"
            )
    if len(time) and time[0] < start:
        raise InputError(f"event 0 has time {time[0]}, before --start {start:g}; start earlier")
    if mapping is None:
        if events.addresses.ndim == 1:
            raise InputError("the events have one address each; give the taxel of each address with --map FILE")
        taxels, kept = events.addresses, np.ones(len(time), bool)
        beyond = (taxels < 0) | (taxels >= (config.columns, config.rows))
        if (wrong := np.flatnonzero(beyond.any(axis=1))).size:
            x, y = taxels[wrong[0]]
            raise InputError(
                f"event {wrong[0]} has x = {x}, y = {y}, outside {config.columns} columns and {config.rows} rows; "
                f"correct --rows and --columns, or give --map FILE"
            )
    else:
        taxels, kept = mapping.apply(events.addresses, drop)
    clocks, moved = _clocks(time[kept], start, events.unit, config)
    merged = len(np.unique(time[kept])) - len(np.unique(clocks))
    if not config.has_polarity and not events.polarity[kept].all():
        raise InputError(f"the file has OFF events, but encoding {config.encoding} sends none; give --encoding lcs")
    made = make_events(clocks, taxels[:, 1], taxels[:, 0], events.polarity[kept])
    ticks = int(clocks[-1]) // config.clocks_per_sample + 1 if len(clocks) else 0
    recording = Recording(made, config, ticks * config.clocks_per_sample, metadata=metadata or {})
    return Taken(recording, int((~kept).sum()), moved, merged, start)


def _seconds(unit: str, config: ReadoutConfig) -> Fraction:
    return 1 / Fraction(config.clock_hz) if unit == CLOCKS else UNITS_S[unit]


def _clocks(time: NDArray[Any], start: float, unit: str, config: ReadoutConfig) -> tuple[NDArray[np.int64], int]:
    """Return times as clocks, rounded half to even, and the number of times that were not whole clocks."""
    per_unit = _seconds(unit, config) * Fraction(config.clock_hz)
    passed = time - start
    if len(time) and float(passed[-1]) * float(per_unit) > MAX_CLOCKS:
        raise InputError(
            f"the events reach {float(passed[-1]) * float(per_unit):.3g} clocks, more than 2**51; split the file"
        )
    if per_unit.denominator == 1 and passed.dtype.kind == "i":
        return passed.astype(np.int64) * per_unit.numerator, 0
    exact = passed * float(per_unit)
    clocks = np.rint(exact).astype(np.int64)
    return clocks, int((np.abs(exact - clocks) > 1e-6 * np.maximum(1, np.abs(exact) * 2**-30)).sum())


def in_unit(recording: Recording, unit: str = "us") -> Events:
    """Return events with the fields t, x, y, p of event libraries such as tonic, shape (events,).

    The unit of t is "clocks" or "us": whole microseconds since the end of reset, rounded half to even. Clocks above
    1 MHz share microseconds.
    """
    if unit not in ("us", CLOCKS):
        raise InputError(f"events are written in us or clocks, not {unit!r}")
    events = recording.events.copy()
    if unit == "us":
        if recording.duration_s * 1e6 >= 2.0**63:
            raise InputError(f"the recording lasts {recording.duration_s:g} s, too long for microseconds; use clocks")
        events["t"] = np.rint(events["t"] * 1e6 / recording.clock_hz)
    return events


def lost_clocks(before: NDArray[Any], after: NDArray[Any]) -> str:
    """Return a warning about clocks that map to one time stamp, or an empty text."""
    lost = len(np.unique(before)) - len(np.unique(after))
    return f"{lost} clocks share their time stamp with another and cannot be told apart again" if lost else ""
