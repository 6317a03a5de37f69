"""Find the first difference between two event recordings."""

from dataclasses import dataclass
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eskin.model.address_events import Events, taxel_of
from eskin.model.config import ReadoutConfig

CONTEXT = 3
"""Events shown before and after a difference."""


class AddressEvent(NamedTuple):
    """One address event as Python integers: clock of the transfer, address of the taxel, and True for ON."""

    t: int
    row: int
    column: int
    polarity: bool

    def __str__(self) -> str:
        sign = "ON" if self.polarity else "OFF"
        return f"clock {self.t}, row {self.row}, column {self.column}, {sign}"


@dataclass(frozen=True)
class Difference:
    """The first difference between two recordings."""

    index: int  # number of the event, counted from 0; all events before it are equal
    start: int  # number of the first event of the context
    context_a: tuple[AddressEvent, ...]  # the events ``start`` .. ``index + 3``, as far as they exist
    context_b: tuple[AddressEvent, ...]

    @property
    def a(self) -> AddressEvent | None:
        """Event of the first recording at the index; None after its end."""
        return next(iter(self.context_a[self.index - self.start :]), None)

    @property
    def b(self) -> AddressEvent | None:
        """Event of the second recording at the index; None after its end."""
        return next(iter(self.context_b[self.index - self.start :]), None)

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields that differ; empty if one recording has ended."""
        if self.a is None or self.b is None:
            return ()
        names = ("clock", "row", "column", "polarity")
        return tuple(n for n, a, b in zip(names, self.a, self.b, strict=True) if a != b)

    def describe(self, labels: tuple[str, str] = ("expected", "got")) -> str:
        """Return the difference as text: a sentence, then the surrounding events side by side."""
        a, b = (f"{label} {event or 'nothing more'}" for label, event in zip(labels, (self.a, self.b), strict=True))
        where = f" in {', '.join(self.fields)}" if self.fields else ""
        lines = [f"event {self.index} differs{where}: {a}; {b}", "", _table_line(" ", "event", *labels)]
        sides = zip_longest(map(_short, self.context_a), map(_short, self.context_b), fillvalue="-")
        for number, (a, b) in enumerate(sides, self.start):
            mark = ">" if number == self.index else " " if a == b else "!"
            lines.append(_table_line(mark, str(number), a, b))
        return "\n".join(lines)


def _table_line(mark: str, number: str, a: str, b: str) -> str:
    return f"{mark} {number:>9}   {a:<30} {b}".rstrip()


def _short(event: AddressEvent) -> str:
    sign = "ON" if event.polarity else "OFF"
    return f"t {event.t}  ({event.row}, {event.column})  {sign}"


def _address_events(events: Events) -> tuple[AddressEvent, ...]:
    return tuple(AddressEvent(int(e["t"]), int(e["y"]), int(e["x"]), bool(e["p"])) for e in events)


def first_difference(a: Events, b: Events) -> Difference | None:
    """Return the first difference between two recordings, or None if they are equal.

    Recordings are equal if clock, row, column and polarity of all events agree, in the same order.
    """
    common = min(len(a), len(b))
    differs = np.flatnonzero(a[:common] != b[:common])
    if not len(differs) and len(a) == len(b):
        return None
    index = int(differs[0]) if len(differs) else common
    start, stop = max(0, index - CONTEXT), index + CONTEXT + 1
    return Difference(index, start, _address_events(a[start:stop]), _address_events(b[start:stop]))


def count_per_taxel(events: Events, config: ReadoutConfig) -> NDArray[np.int64]:
    """Return the number of events of every taxel, shape (rows, columns)."""
    index = taxel_of(events, config)
    return np.bincount(index, minlength=config.taxels).reshape(config.rows, config.columns)


def covering_config(a: ReadoutConfig, b: ReadoutConfig) -> ReadoutConfig:
    """Return a configuration that covers addresses and polarities of both recordings, at the clock of the first."""
    polar = next((c for c in (a, b) if c.has_polarity), a)
    return polar.replace(
        rows=max(a.rows, b.rows),
        columns=max(a.columns, b.columns),
        sample_rate_hz=a.sample_rate_hz,
        clocks_per_sample=a.clocks_per_sample,
    )


def unmatched(a: Events, b: Events) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the events of each recording that the other lacks, ignoring order.

    An event that stands n times in one and m times in the other is unmatched in the last n - m places. The two bool
    arrays have the shapes (events_a,) and (events_b,).
    """
    both: NDArray[Any] = np.concatenate([a, b])
    in_a = np.arange(len(both)) < len(a)
    alone = np.zeros(len(both), np.bool_)
    if not len(both):
        return alone, alone
    # Equal events become neighbours, those of a first.
    order = np.lexsort((~in_a, both["p"], both["x"], both["y"], both["t"]))
    ordered = both[order]
    group = np.concatenate([[0], np.cumsum(ordered[1:] != ordered[:-1])])
    size_a = np.bincount(group, weights=in_a[order]).astype(np.int64)
    size_b = np.bincount(group) - size_a
    first = np.searchsorted(group, np.arange(group[-1] + 1))
    rank = np.arange(len(both)) - first[group]
    rank = np.where(in_a[order], rank, rank - size_a[group])
    alone[order] = rank >= np.minimum(size_a, size_b)[group]
    return alone[: len(a)], alone[len(a) :]
