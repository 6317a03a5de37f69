"""Scoreboard for an arbiter that serves several sources in an order of its own."""

from collections import deque
from collections.abc import Callable, Hashable
from typing import Any

from cocotbext.aer.event import AerEvent


def _address(event: AerEvent) -> int:
    return event.address


class AerFunnel:
    """Expected events of several sources: each source keeps its order, and the sources mix in any order.

    Parameters
    ----------
    source : function, optional
        Returns the source of an event; by default its address. Give ``lambda event: event.address >> 8`` if the upper
        bits name one of several chips.
    """

    def __init__(self, source: Callable[[AerEvent], Hashable] = _address) -> None:
        self.source = source
        self.expected: dict[Any, deque[AerEvent]] = {}
        self.checked = 0

    def expect(self, *events: AerEvent | int) -> None:
        """Add events that the arbiter will send, in the order of their source; a number is an address."""
        for item in events:
            event = item if isinstance(item, AerEvent) else AerEvent(item)
            self.expected.setdefault(self.source(event), deque()).append(event)

    def check(self, event: AerEvent) -> None:
        """Compare an event with the next expected event of its source.

        Raises
        ------
        AssertionError
            If its source has another event before it, or no event at all.
        """
        source = self.source(event)
        waiting = self.expected.get(source)
        if not waiting:
            raise AssertionError(f"{event} was not expected: no event of source {source} is left")
        if waiting[0] != event:
            raise AssertionError(f"{event} came where source {source} has {waiting[0]} first")
        waiting.popleft()
        self.checked += 1

    def finish(self) -> None:
        """Check that every expected event has come, and that there was one.

        Raises
        ------
        AssertionError
            If an event is missing, or if none was ever checked.
        """
        if missing := [event for waiting in self.expected.values() for event in waiting]:
            raise AssertionError(f"{len(missing)} events did not come, first {missing[0]}")
        if not self.checked:
            raise AssertionError("no event was checked")
