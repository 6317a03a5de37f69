"""Arbiter: one row at a time, with its requests in a queue in rising column order."""


class Arbiter:
    """Arbiter that grants a row when the queue is empty or sends its last event.

    Attributes
    ----------
    queue : events (row, column, polarity) of the granted row that have not left
    pointer : the row that is looked at first when the next is chosen
    """

    def __init__(self, rows, columns):
        self.rows = rows
        self.columns = columns
        self.reset()

    def reset(self):
        """Reset the arbiter."""
        self.queue = []
        self.pointer = 0

    def output(self):
        """Event offered in this clock, or None."""
        return self.queue[0] if self.queue else None

    def granted_row(self, requests, ready):
        """Return the row granted in this clock, or None; `requests` has None or a polarity for each row and column."""
        left = len(self.queue) - (1 if self.queue and ready else 0)
        if left:
            return None
        for distance in range(self.rows):
            row = (self.pointer + distance) % self.rows
            if any(request is not None for request in requests[row]):
                return row
        return None

    def clock(self, requests, ready):
        """Apply a rising edge; return (row, column) of the latched requests."""
        row = self.granted_row(requests, ready)
        if self.queue and ready:
            self.queue.pop(0)
        if row is None:
            return []
        self.pointer = (row + 1) % self.rows
        taken = [column for column in range(self.columns) if requests[row][column] is not None]
        self.queue = [(row, column, requests[row][column]) for column in taken]
        return [(row, column) for column in taken]
