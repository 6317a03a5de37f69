"""The four-phase AER link: REQ/ACK handshake with bundled address, for an asynchronous receiver."""

from __future__ import annotations

from typing import Any

from amaranth.hdl import Cat, Module, Signal
from amaranth.lib.wiring import In, Out

from eskin.model.config import ReadoutConfig
from eskin.rtl.arbiter import event_ports
from eskin.rtl.block import Block


class FourPhaseLink(Block[ReadoutConfig]):
    """Sends the event stream over REQ/ACK.

    An event is taken at clock t, REQ rises at the edge of t + 1, falls at the edge that sees ACK through two flops,
    and the next event may be taken in the clock that sees ACK low again: 7 clocks per event with a receiver that
    answers at once. The address is stable one clock before REQ rises and until ACK has fallen.

    Attributes
    ----------
    event_valid, event_ready, event_row, event_col, event_polarity
        The stream of address events.
    aer_req, aer_ack : Out(1), In(1)
        Handshake; ``aer_ack`` is asynchronous, ``aer_req`` a flop.
    aer_addr : Out(event_bits)
        {polarity, row, column}, a register; absent where it would have no bit.
    """

    module_name = "eskin_link"

    def __init__(self, config: ReadoutConfig) -> None:
        super().__init__(config, {**event_ports(config, In), **aer_ports(config)})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        # After reset ACK counts as high until it has been seen low, or a receiver that still holds it would be missed.
        ack_meta = Signal(init=1)
        ack_sync = Signal(init=1)
        m.d.sync += [ack_meta.eq(self.aer_ack), ack_sync.eq(ack_meta)]

        request = Signal()
        setup = Signal()
        m.d.comb += [
            # While REQ is high ACK follows, and both flops hold it for two clocks after: no further state is needed.
            self.event_ready.eq(~setup & ~request & ~ack_sync),
            self.aer_req.eq(request),
        ]
        m.d.sync += setup.eq(self.event_valid & self.event_ready)
        with m.If(setup):
            m.d.sync += request.eq(1)
        with m.Elif(ack_sync):
            m.d.sync += request.eq(0)

        if self.config.event_bits:
            address = Signal(self.config.event_bits)
            fields = [n for n in ("event_col", "event_row", "event_polarity") if n in self.signature.members]
            with m.If(self.event_valid & self.event_ready):
                m.d.sync += address.eq(Cat(getattr(self, name) for name in fields))
            m.d.comb += self.aer_addr.eq(address)
        return m


def aer_ports(config: ReadoutConfig) -> dict[str, Any]:
    """Return the ports of the four-phase link; without address bits there is no address."""
    address = {"aer_addr": Out(config.event_bits)} if config.event_bits else {}
    return {"aer_req": Out(1), "aer_ack": In(1), **address}
