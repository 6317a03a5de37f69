"""The valid/ready stream: the arbiter's own output."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from eskin.model.links.link import NOTHING, Bits, Link, Read, Shown, Sink, Timing, parts, shifted

if TYPE_CHECKING:
    from eskin.model.config import ReadoutConfig


class StreamTiming(Timing):
    """Constants of the stream."""


class Stream(Link):
    """valid/ready stream with separate row, column and polarity."""

    name = "stream"
    title = "stream"
    leaves = "`event_valid`"
    at_best = "sink always ready"
    clocks_per_event = 1
    holds = 0
    streams = True
    address = ("event_row", "event_col", "event_polarity")
    Rule: ClassVar = StreamTiming

    def shown(self, config: ReadoutConfig, read: Read, bits: Bits = shifted) -> Shown:
        polarity = read("event_polarity") if config.has_polarity else 1
        return Shown((read("event_valid") & read("event_ready"),), read("event_row"), read("event_col"), polarity)

    def levels(self, config: ReadoutConfig, state: Any, sink: Sink, clock: int, offered: int) -> dict[str, int | None]:
        there = offered != NOTHING
        found: dict[str, int | None] = {
            "event_valid": int(there),
            "event_ready": int(self.ready(None, state, sink, clock)),
        }
        widths = (config.row_bits, config.column_bits, config.has_polarity)
        for name, value, width in zip(self.address, parts(config, offered), widths, strict=True):
            if width:
                found[name] = value if there else None
        return found

    def rule(self) -> StreamTiming:
        return StreamTiming(late=0)

    def new_state(self) -> NDArray[np.int64]:
        return np.zeros(1, np.int64)  # none; Numba needs an array

    @staticmethod
    def ready(rule: Any, state: Any, sink: Any, clock: int) -> bool:
        return sink.ready[clock % len(sink.ready)] != 0

    @staticmethod
    def advance(rule: Any, state: Any, sink: Any, clock: int, taken: int) -> int:
        return taken

    @staticmethod
    def rests(rule: Any, state: Any) -> bool:
        return True
