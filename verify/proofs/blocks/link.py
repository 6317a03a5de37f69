"""Properties of the four-phase link and of the AXI4-Stream: protocol, and exactly one transfer per event."""

from typing import Any, ClassVar

from amaranth.hdl import Cat, Const, Module, Mux, Signal, Value

from eskin.model.bus.config import BusConfig
from eskin.model.config import ReadoutConfig
from eskin.rtl.bus.axi_stream import ORDER, AxiStream
from eskin.rtl.links.four_phase import FourPhaseLink
from eskin.verify.proofs.checker import Checker, Promises, before, implies


class LinkChecker(Checker[ReadoutConfig]):
    """Checker of the four-phase link; ACK is free."""

    block = FourPhaseLink
    only: ClassVar = {
        "request_of_polarity": lambda config: config.protocol.request_has_polarity,
        "address_of_event": lambda config: config.address_bits > 0,
        "address_stable": lambda config: config.address_bits > 0,
    }
    assumptions: ClassVar = {
        "ack_follows_req": "ACK rises only while REQ is high and falls only while it is low; a reset may break that off"
    }

    def check(self, m: Module) -> Promises:
        ack, taken = self.aer_ack, self.event_valid & self.event_ready
        req = Cat(getattr(self, name) for name in self.config.protocol.requests).any()
        req_before, ack_before = before(m, req, "req"), before(m, ack, "ack")
        rises, falls = req & ~req_before, ~req & req_before

        # A receiver: after a reset ACK may still be high.
        known, kept = Signal(), Signal(init=1)
        follows = ~known | ~((ack & ~ack_before & ~req) | (~ack & ack_before & req))
        m.d.sync += [known.eq(1), kept.eq(kept & follows)]
        receiver = kept & follows
        self.suppose(m, "ack_follows_req", follows)

        setup = before(m, taken, "taken")
        due = before(m, setup, "setup")
        yield "one_pulse_per_event", rises == due, rises
        busy = Signal()
        m.d.sync += busy.eq(taken | (busy & ~(req_before & ~req)))
        in_hand = busy & ~falls
        yield "one_at_a_time", implies(self.event_ready, ~in_hand), self.event_ready & falls

        yield from self._address(m, taken, setup, req, receiver)
        if self.config.protocol.request_has_polarity:
            on = Signal()
            with m.If(taken):
                m.d.sync += on.eq(self.event_polarity)
            named = ~(self.aer_req_on & self.aer_req_off) & implies(req, self.aer_req_on == on)
            yield "request_of_polarity", named, self.aer_req_off

        # ACK passes two flops: REQ falls for an ACK of at least two clocks ago, within the same REQ.
        answered = Signal()
        m.d.sync += answered.eq(req & (answered | ack))
        yield "req_waits_for_ack", implies(falls & receiver, answered), falls & receiver
        yield "req_after_ack_low", implies(rises & receiver, ~ack_before), rises & receiver & ack
        # In the first clocks after a reset ACK counts as high.
        stages = [Signal(init=1, name=f"ack_{clocks}_before") for clocks in (1, 2, 3)]
        m.d.sync += [new.eq(old) for new, old in zip(stages, [ack, *stages[:2]], strict=True)]
        passed = implies(self.event_ready, ~stages[1]) & implies(falls, stages[2])
        yield "ack_is_synchronised", passed, self.event_ready & ack
        for name, waiting, done in (
            ("req_answers_ack", req & ack, ~req),
            ("ready_answers_ack", ~in_hand & ~ack & ~req & ~setup, self.event_ready),
        ):
            clocks = self.count_to(m, 4, ~waiting, 1, name=f"{name}_clocks")
            full = 3 if name == "req_answers_ack" else 2
            yield name, implies((clocks >= full) & waiting, done), clocks == full

    def _address(self, m: Module, taken: Any, setup: Signal, req: Any, receiver: Any) -> Promises:
        polarity = [] if self.config.protocol.request_has_polarity else ["event_polarity"]
        fields = Cat(getattr(self, n) for n in ("event_col", "event_row", *polarity) if self.has(n))
        if not len(fields):
            return
        held_event = Signal(len(fields))
        with m.If(taken):
            m.d.sync += held_event.eq(fields)
        shown = setup | req
        yield "address_of_event", implies(shown, self.aer_addr == held_event), shown & held_event.any()
        moved = self.aer_addr != before(m, self.aer_addr, "address")
        held = before(m, req | (self.aer_ack & receiver), "held") | req
        held &= receiver | req
        yield "address_stable", implies(held, ~moved), held & Const(1)


class AxiStreamChecker(Checker[BusConfig]):
    """Checker of the AXI4-Stream; both sides are free."""

    block = AxiStream
    only: ClassVar = {
        "packet_of_one_row": lambda config: config.readout.column_bits > 0,
        "packet_without_pause": lambda config: config.readout.column_bits > 0,
    }

    def check(self, m: Module) -> Promises:
        comes, leaves = self.event_valid & self.event_ready, self.m_axis_tvalid & self.m_axis_tready
        inside = Signal(range(4))
        m.d.sync += inside.eq(inside + comes - leaves)
        event = Cat(self.port(name) for name in ORDER if self.has(name))
        clock = Signal(self.config.time_bits)
        m.d.sync += clock.eq(clock + 1)
        word = Cat(event, clock)
        oldest, newest = (Signal(len(word), name=name) for name in ("oldest", "newest"))
        with m.If(comes):
            m.d.sync += newest.eq(word)
        with m.If(comes & (inside == leaves)):
            m.d.sync += oldest.eq(word)
        with m.Elif(leaves):
            m.d.sync += oldest.eq(newest)

        payload = Cat(self.m_axis_tdata, self.m_axis_tlast)
        yield "tvalid_waits", *self.unchanged(m, self.m_axis_tvalid, self.m_axis_tready, payload)
        fits = (inside < 2) | self.m_axis_tready
        yield "takes_what_fits", self.event_ready == fits, self.event_valid & ~fits
        counts = (inside <= 2) & implies(inside == 2, self.m_axis_tvalid) & implies(self.m_axis_tvalid, inside != 0)
        yield "none_lost", counts, inside == 2
        yield "in_order", implies(leaves, self.m_axis_tdata == oldest), leaves & (inside == 2)
        came = before(m, before(m, comes, "came"), "came_earlier")
        yield "leaves_in_two_clocks", implies(came, self.m_axis_tvalid), came & before(m, leaves, "left")

        moves = ((inside == 2) & leaves) | ((inside == 1) & ~self.m_axis_tvalid)
        last = self.keep(m, Signal(init=1, name="ends"), 0, moves, ~(self.event_valid & self._follows(event, newest)))
        yield "tlast_ends_packet", implies(self.m_axis_tvalid, self.m_axis_tlast == last), leaves & self.m_axis_tlast
        if self.config.readout.column_bits:
            inner = Signal()
            m.d.sync += inner.eq(Mux(leaves, ~self.m_axis_tlast, inner))
            sent = self.keep(m, Signal(len(word), name="sent"), 0, leaves, self.m_axis_tdata[: len(word)])
            follows = self._follows(self.m_axis_tdata, sent)
            yield "packet_of_one_row", implies(leaves & inner, follows), leaves & inner
            yield "packet_without_pause", implies(inner, self.m_axis_tvalid), inner

    def _follows(self, event: Value, before: Value) -> Value:
        """Return whether an event has the row of the one before it and a higher column."""
        columns, rows = self.config.readout.column_bits, self.config.readout.row_bits
        if not columns:
            return Const(0)
        same = event[columns : columns + rows] == before[columns : columns + rows] if rows else Const(1)
        return same & (event[:columns] > before[:columns])


LINKS = {FourPhaseLink: LinkChecker}
"""Checker of the block of each link that has one."""
