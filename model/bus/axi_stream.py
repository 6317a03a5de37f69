"""Cycle-accurate model of the AXI4-Stream of events."""

from typing import NamedTuple

from eskin.model.bus.config import BusConfig


class Event(NamedTuple):
    """An address event that the arbiter offers; polarity 0 where the encoder has none."""

    column: int
    row: int
    polarity: int


class Transfer(NamedTuple):
    """Payload of a transfer: ``TDATA`` and ``TLAST``."""

    data: int
    last: bool


class AxiStream:
    """Two places for events: one is held until the next clock shows whether its packet goes on, one is offered.

    A packet is a run of events of one row in rising columns without a pause: a burst of the row, or several bursts
    that follow each other directly. The time stamp is the clock, counted from the end of the reset, in which the
    arbiter gave the event.
    """

    def __init__(self, config: BusConfig) -> None:
        self.config = config
        self.reset()

    def reset(self) -> None:
        """Reset the stream and its clock."""
        self.time = 0
        self.held: tuple[Event, int] | None = None  # with its time stamp
        self.offered: Transfer | None = None

    def ready(self, tready: bool) -> bool:
        """Return ``event_ready`` for a level of ``TREADY``."""
        return self.held is None or self.offered is None or tready

    def clock(self, event: Event | None, tready: bool) -> None:
        """Apply a rising edge with the event that the arbiter offers in this clock."""
        ready = self.ready(tready)
        if self.offered is None or tready:
            self.offered = None
            if self.held is not None:
                before, time = self.held
                goes_on = event is not None and event.row == before.row and event.column > before.column
                self.offered = Transfer(self.word(before, time), not goes_on)
        if ready:
            self.held = None if event is None else (event, self.time)
        self.time += 1

    def word(self, event: Event, time: int) -> int:
        """Return ``TDATA`` of an event."""
        values = event._asdict() | {"time stamp": time}
        return sum((values[name] & (1 << bits) - 1) << low for name, (low, bits) in self.config.fields().items())
