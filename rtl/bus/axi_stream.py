"""AXI4-Stream of address events."""

from typing import Any

from amaranth.hdl import Cat, Const, Module, Signal, Value
from amaranth.lib.wiring import In, Out

from eskin.model.bus.config import BusConfig
from eskin.rtl.arbiter import event_ports
from eskin.rtl.block import Block

ORDER = ("event_col", "event_row", "event_polarity")
"""Ports of an event in ``TDATA``, from the least significant bit on."""

SINK = """\
  // The sink is always ready.
  always @(posedge aclk) begin
    m_axis_tready <= 1'b1;
    if (running && m_axis_tvalid && m_axis_tready) check(clock, {m_axis_tlast, m_axis_tdata});
  end
"""
"""Sink of the delivered testbench."""


def stream_ports(config: BusConfig) -> dict[str, Any]:
    """Return the ports of the stream."""
    return {
        "m_axis_tvalid": Out(1),
        "m_axis_tready": In(1),
        "m_axis_tdata": Out(config.data_bits),
        "m_axis_tlast": Out(1),
    }


class AxiStream(Block[BusConfig]):
    """Source of an AXI4-Stream behind the arbiter's stream.

    An event is held for one clock: the event that the arbiter offers in this clock shows whether the packet goes on.
    ``TLAST`` is low if that event has the same row and a higher column, so an event is never held longer than the
    sink waits. Latency: two clocks from ``event_valid`` to ``TVALID``. Throughput: one event per clock. All outputs to
    the bus are registers.

    Attributes
    ----------
    event_valid, event_ready, event_row, event_col, event_polarity
        The stream of address events.
    m_axis_tvalid, m_axis_tready : Out(1), In(1)
        Handshake.
    m_axis_tdata : Out(data_bits)
        {0, time stamp, polarity, row, column}; the time stamp is the clock in which the event was taken.
    m_axis_tlast : Out(1)
        The packet ends.
    """

    module_name = "eskin_axi_stream"

    def __init__(self, config: BusConfig) -> None:
        super().__init__(config, {**event_ports(config.readout, In), **stream_ports(config)})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        held, valid, last = Signal(name="held"), Signal(name="valid"), Signal(name="last")
        moves, comes, goes_on = Signal(name="moves"), Signal(name="comes"), Signal(name="goes_on")
        m.d.comb += [
            moves.eq(~valid | self.m_axis_tready),
            self.event_ready.eq(~held | moves),
            comes.eq(self.event_valid & self.event_ready),
            self.m_axis_tvalid.eq(valid),
            self.m_axis_tlast.eq(last),
        ]
        fields = [getattr(self, name) for name in ORDER if name in self.signature.members]
        if bits := self.config.time_bits:
            clock = Signal(bits, name="clock")
            m.d.sync += clock.eq((clock + 1)[:bits])
            fields.append(clock)
        event: Value = Cat(fields)
        waiting, offered = Signal(len(event), name="held_event"), Signal(len(event), name="offered_event")
        m.d.comb += [goes_on.eq(self._goes_on(waiting)), self.m_axis_tdata.eq(offered)]
        with m.If(self.event_ready):
            m.d.sync += held.eq(self.event_valid)
        with m.If(comes):
            m.d.sync += waiting.eq(event)
        with m.If(moves):
            m.d.sync += valid.eq(held)
        with m.If(moves & held):
            m.d.sync += [offered.eq(waiting), last.eq(~goes_on)]
        return m

    def _goes_on(self, waiting: Signal) -> Value:
        """Return whether the offered event continues the packet of the held event."""
        config = self.config.readout
        if not config.column_bits:
            return Const(0)
        rises = self.event_col > waiting[: config.column_bits]
        row_ends = config.column_bits + config.row_bits
        same = self.event_row == waiting[config.column_bits : row_ends] if config.row_bits else Const(1)
        return self.event_valid & rises & same
