"""Address events in memory: one structured array (docs/specification.md, section 5)."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig

EVENT_DTYPE = np.dtype([("t", "<i8"), ("x", "<i2"), ("y", "<i2"), ("p", "?")])
"""One address event: t in clocks since the end of reset, x = column, y = row, p True = ON.

The fields are those that event tools (tonic, for one) expect. The events of a unipolar encoder have p True.
"""


Events = NDArray[Any]
"""A 1-D array of EVENT_DTYPE, in the order of the transfers: t never falls."""


def make_events(t: ArrayLike, row: ArrayLike, column: ArrayLike, polarity: ArrayLike = True) -> Events:
    """Return an event array for clocks, rows (y), columns (x) and polarities (True = ON), arrays or scalars."""
    t, row, column, polarity = np.broadcast_arrays(np.atleast_1d(t), row, column, polarity)
    events = np.empty(t.shape, EVENT_DTYPE)
    events["t"], events["x"], events["y"], events["p"] = t, column, row, polarity
    return events


def no_events() -> Events:
    """Return an empty event array."""
    return np.empty(0, EVENT_DTYPE)


def taxel_of(events: Events, config: ReadoutConfig) -> NDArray[np.int64]:
    """Return the taxel index of every event, row * columns + column, shape (events,)."""
    taxel: NDArray[np.int64] = events["y"].astype(np.int64) * config.columns + events["x"]
    return taxel


def check_events(events: Events, config: ReadoutConfig, duration_clocks: int) -> None:
    """Check the type, the order, the addresses and the duration of events."""
    if not isinstance(events, np.ndarray) or events.dtype != EVENT_DTYPE or events.ndim != 1:
        got = f"shape {events.shape} of {events.dtype}" if isinstance(events, np.ndarray) else type(events).__name__
        raise InputError(f"events must be a one-dimensional array with the fields t, x, y, p, not {got}")
    if duration_clocks < 0:
        raise InputError(f"duration_clocks must not be negative, not {duration_clocks}")
    if not len(events):
        return
    limits = (
        ("t", duration_clocks, "the duration in clocks"),
        ("x", config.columns, "columns"),
        ("y", config.rows, "rows"),
    )
    for name, limit, what in limits:
        column = events[name]
        if wrong := np.flatnonzero((column < 0) | (column >= limit)).tolist():
            raise InputError(f"event {wrong[0]} has {name} = {column[wrong[0]]}, outside 0..{limit - 1} ({what})")
    if wrong := np.flatnonzero(np.diff(events["t"]) < 0).tolist():
        raise InputError(f"event {wrong[0] + 1} is earlier than the event before it")
    # A boolean is one byte; anything but 0 and 1 in it would print as True and compare as different.
    if wrong := np.flatnonzero(events["p"].view(np.uint8) > 1).tolist():
        raise InputError(f"event {wrong[0]} has a polarity that is neither 0 nor 1")
    if not config.has_polarity and not events["p"].all():
        raise InputError(f"event {int(np.argmin(events['p']))} is OFF, which encoding nlcs never sends")
