"""Links between arbiter and receiver.

In each clock look at `ready` and `outputs`, then call `clock` with the inputs of the same clock: it returns the event
that leaves.
"""

from collections.abc import Sequence
from typing import Any

from eskin.cocotb_tests.independent.arbiter import Event


class Stream:
    """The arbiter's event with valid, taken in the clocks with ready."""

    def reset(self) -> None:
        """Reset the link, which has no state."""

    def ready(self, ready: bool = True) -> bool:
        """Return whether the link accepts an event in this clock."""
        return ready

    def outputs(self, offered: Event | None) -> dict[str, Any]:
        """Return the outputs in this clock by port name."""
        row, column, polarity = offered or (0, 0, 0)
        return {"event_valid": offered is not None, "event_row": row, "event_col": column, "event_polarity": polarity}

    def clock(self, offered: Event | None, acknowledge: int, ready: bool = True) -> Event | None:
        """Apply a rising edge with the arbiter's event, or None, and the receiver's `event_ready`."""
        return offered if ready else None


class FourPhaseLink:
    """Link that takes an event while idle with synchronised ACK low; address, REQ one clock later, ACK, REQ low.

    Attributes
    ----------
    state : "rest" (REQ low), "address" (stable, REQ still low), "request" (REQ high)
    event : what stands on the address wires
    flops : ACK one clock and two clocks ago
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Reset the link."""
        self.state = "rest"
        self.event: Event | None = None
        self.flops = [1, 1]

    def request(self) -> int:
        """Return the level of REQ in this clock."""
        return 1 if self.state == "request" else 0

    def outputs(self, offered: Event | None) -> dict[str, Any]:
        """Return the outputs in this clock by port name."""
        return {"aer_req": self.request(), "aer_addr": self.event}

    def ready(self, ready: bool = True) -> bool:
        """Return whether the link accepts an event in this clock."""
        return self.state == "rest" and not self.flops[1]

    def clock(self, offered: Event | None, acknowledge: int, ready: bool = True) -> Event | None:
        """Apply a rising edge with the arbiter's event, or None, and the wire ACK, 0 or 1."""
        seen, left = self.flops[1], None
        if self.ready() and offered is not None:
            self.event = offered
            self.state = "address"
        elif self.state == "address":
            self.state, left = "request", self.event
        elif self.state == "request" and seen:
            self.state = "rest"
        self.flops = [acknowledge, self.flops[0]]
        return left


LINKS: dict[str, type[Stream | FourPhaseLink]] = {
    "stream": Stream,
    "four_phase": FourPhaseLink,
    "four_phase_dual": FourPhaseLink,
}


class Receiver:
    """Asynchronous receiver: ACK follows each edge of REQ after a delay.

    The delays, in 1/8 clock, repeat, and are never a multiple of 8.
    """

    def __init__(self, delays: Sequence[int]) -> None:
        self.delays = delays
        self.edges = self.req = self.ack = 0
        self.at = 0  # when ACK follows, in 1/8 clock

    def ack_at(self, clock: int) -> int:
        """Return the level of ACK just before a clock edge."""
        if 8 * clock > self.at:
            self.ack = self.req
        return self.ack

    def see(self, req: int, clock: int) -> None:
        """Sample REQ just after a clock edge."""
        if req != self.req:
            self.req = req
            self.at = 8 * clock + self.delays[self.edges % len(self.delays)]
            self.edges += 1
