"""Arbiter: one row at a time, with its requests in a queue in rising column order."""

from collections.abc import Sequence

Event = tuple[int, int, int]
"""Row, column and polarity (1 ON, 0 OFF) of an event."""

Requests = Sequence[Sequence[int | None]]
"""Polarity of the request of each row and column, or None."""


class Arbiter:
    """Arbiter that grants a row when the queue is empty or sends its last event.

    Attributes
    ----------
    queue : events (row, column, polarity) of the granted row that have not left
    pointer : the row that is looked at first when the next is chosen
    """

    def __init__(self, rows: int, columns: int) -> None:
        self.rows = rows
        self.columns = columns
        self.reset()

    def reset(self) -> None:
        """Reset the arbiter."""
        self.queue: list[Event] = []
        self.pointer = 0

    def output(self) -> Event | None:
        """Return the event offered in this clock, or None."""
        return self.queue[0] if self.queue else None

    def granted_row(self, requests: Requests, ready: bool) -> int | None:
        """Return the row granted in this clock, or None."""
        left = len(self.queue) - (1 if self.queue and ready else 0)
        return None if left else self.next_row(requests)

    def next_row(self, requests: Requests) -> int | None:
        """Return the row that is granted next, or None."""
        for distance in range(self.rows):
            row = (self.pointer + distance) % self.rows
            if any(request is not None for request in requests[row]):
                return row
        return None

    def clock(self, requests: Requests, ready: bool) -> list[tuple[int, int]]:
        """Apply a rising edge; return (row, column) of the latched requests."""
        row = self.granted_row(requests, ready)
        if self.queue and ready:
            self.queue.pop(0)
        if row is None:
            return []
        self.pointer = (row + 1) % self.rows
        asking = enumerate(requests[row])
        self.queue = [(row, column, polarity) for column, polarity in asking if polarity is not None]
        return [(row, column) for row, column, _ in self.queue]
