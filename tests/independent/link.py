"""Four-phase link: address, REQ one clock later, ACK through two flops, REQ low, ACK low."""


class FourPhaseLink:
    """Link that takes an event while idle with synchronised ACK low.

    Attributes
    ----------
    state : "rest" (REQ low), "address" (stable, REQ still low), "request" (REQ high)
    event : what stands on the address wires
    flops : ACK one clock and two clocks ago
    """

    def __init__(self):
        self.reset()

    def reset(self):
        """Reset the link."""
        self.state = "rest"
        self.event = None
        self.flops = [1, 1]

    def request(self):
        """Level of REQ in this clock."""
        return 1 if self.state == "request" else 0

    def ready(self):
        """Return whether the link accepts an event in this clock."""
        return self.state == "rest" and not self.flops[1]

    def clock(self, offered, acknowledge):
        """Apply a rising edge with the arbiter's event, or None, and the wire ACK, 0 or 1."""
        seen = self.flops[1]
        if self.ready() and offered is not None:
            self.event = offered
            self.state = "address"
        elif self.state == "address":
            self.state = "request"
        elif self.state == "request" and seen:
            self.state = "rest"
        self.flops = [acknowledge, self.flops[0]]
