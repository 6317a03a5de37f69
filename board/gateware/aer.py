"""Receiver for the four-phase AER link of another chip."""

from typing import Any

from amaranth.hdl import Module, Mux, Signal
from amaranth.lib.cdc import FFSynchronizer
from amaranth.lib.wiring import Component, In, Out

from eskin.board.config import ADDRESS_BITS, BOTH_FLAG, OFF_FLAG
from eskin.board.gateware.recorder import CLOCK_BITS
from eskin.board.records import VALUE_BITS


class AerReceiver(Component):
    """AER receiver that samples the address after REQ has passed a two-flop synchroniser.

    ACK rises when the event is kept, or is lost because the memory is full: time is never bought by holding the foreign
    chip back. A REQ that is high when reset ends is a new request. At most one event in 7 clocks, with a sender that
    answers at once.

    A chip with two requests has that of ON at ``aer_req`` and that of OFF at ``aer_req_off``. OFF sets ``OFF_FLAG`` in
    the address, both at once also ``BOTH_FLAG``. Pins are active high; requests and address are asynchronous, ACK is a
    flop.
    """

    def __init__(self) -> None:
        super().__init__(
            {
                "aer_req": In(1),
                "aer_req_off": In(1),
                "aer_ack": Out(1),
                "aer_addr": In(ADDRESS_BITS),
                "now": In(CLOCK_BITS),
                "full": In(1),  # the memory has no place for an event
                "valid": Out(1),
                "ready": In(1),
                "address": Out(ADDRESS_BITS),
                "time": Out(CLOCK_BITS),  # clock in which REQ was seen, two to three clocks after its rise
                "lost": Out(VALUE_BITS),  # events lost since the last report; saturates
                "lost_told": In(1),
                "lost_now": Out(1),  # an event is lost in this clock
            }
        )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        on, off, request, address = Signal(), Signal(), Signal(), Signal(ADDRESS_BITS)
        m.submodules.synchroniser = FFSynchronizer(self.aer_req, on)
        m.submodules.synchroniser_off = FFSynchronizer(self.aer_req_off, off)
        m.d.comb += [
            request.eq(on | off),
            self.address.eq(address | Mux(off, OFF_FLAG, 0) | Mux(on & off, BOTH_FLAG, 0)),
        ]
        with m.If(self.lost_told):
            m.d.sync += self.lost.eq(0)
        with m.Elif(self.lost_now & ~self.lost.all()):
            m.d.sync += self.lost.eq(self.lost + 1)
        with m.FSM():
            with m.State("REST"), m.If(request):
                m.d.sync += [address.eq(self.aer_addr), self.time.eq(self.now)]
                m.next = "KEEP"
            with m.State("KEEP"):
                m.d.comb += [self.valid.eq(~self.full), self.lost_now.eq(self.full)]
                with m.If(self.full | self.ready):
                    m.d.sync += self.aer_ack.eq(1)
                    m.next = "ANSWER"
            with m.State("ANSWER"), m.If(~request):
                m.d.sync += self.aer_ack.eq(0)
                m.next = "REST"
        return m
