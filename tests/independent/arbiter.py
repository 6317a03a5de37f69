"""The arbiter: one row at a time, its requests drained from a queue in rising column order."""


class Arbiter:
    """A row is granted where the queue is empty, or gives up its last event in this clock.

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
        """Return to the state behind a reset."""
        self.queue = []
        self.pointer = 0

    def output(self):
        """The event that is offered in this clock, or None."""
        return self.queue[0] if self.queue else None

    def granted_row(self, requests, ready):
        """The row that is granted in this clock, or None.

        Parameters
        ----------
        requests : list of rows, each a list of None or polarity
        ready : the sink takes an event in this clock
        """
        left = len(self.queue) - (1 if self.queue and ready else 0)
        if left:
            return None
        for distance in range(self.rows):
            row = (self.pointer + distance) % self.rows
            if any(request is not None for request in requests[row]):
                return row
        return None

    def clock(self, requests, ready):
        """One rising edge; returns the (row, column) of the requests that it takes."""
        row = self.granted_row(requests, ready)
        if self.queue and ready:
            self.queue.pop(0)
        if row is None:
            return []
        self.pointer = (row + 1) % self.rows
        taken = [column for column in range(self.columns) if requests[row][column] is not None]
        self.queue = [(row, column, requests[row][column]) for column in taken]
        return [(row, column) for column in taken]
