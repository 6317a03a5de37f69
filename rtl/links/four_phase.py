"""Four-phase AER link: REQ/ACK handshake with bundled address, for an asynchronous receiver."""

from typing import Any

from amaranth.hdl import Cat, Module, Signal
from amaranth.lib.wiring import In, Out

from eskin.model.config import ReadoutConfig
from eskin.rtl.arbiter import event_ports
from eskin.rtl.block import Block
from eskin.rtl.links.link import ACK_EIGHTHS, Hardware, joined


class FourPhaseLink(Block[ReadoutConfig]):
    """Sender of the event stream over REQ/ACK, with one request line, or with one for ON and one for OFF events.

    An event is taken at clock t, REQ rises at the edge of t + 1, falls at the edge that sees ACK through two flops,
    and the next event may be taken in the clock that sees ACK low again: 7 clocks per event with a receiver that
    answers at once. The address is stable one clock before REQ rises and until ACK has fallen.

    Attributes
    ----------
    event_valid, event_ready, event_row, event_col, event_polarity
        The stream of address events.
    aer_req, aer_ack : Out(1), In(1)
        Handshake; ``aer_ack`` is asynchronous, ``aer_req`` a flop.
    aer_req_on, aer_req_off : Out(1)
        In place of ``aer_req`` where the request names the polarity: the flop that is high.
    aer_addr : Out(address_bits)
        {polarity, row, column}, a register, without the polarity where the request names it; absent where it would
        have no bit.
    """

    module_name = "eskin_link"

    def __init__(self, config: ReadoutConfig) -> None:
        super().__init__(config, {**event_ports(config, In), **aer_ports(config)})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        # After reset ACK counts as high until it has been seen low: a receiver may still hold it.
        ack_meta = Signal(init=1)
        ack_sync = Signal(init=1)
        m.d.sync += [ack_meta.eq(self.aer_ack), ack_sync.eq(ack_meta)]

        request = Signal()
        setup = Signal()
        # While REQ is high, ACK follows, and both flops hold ACK for two more clocks: no further state is needed.
        m.d.comb += self.event_ready.eq(~setup & ~request & ~ack_sync)
        m.d.sync += setup.eq(self.event_valid & self.event_ready)
        fields = [n for n in ("event_col", "event_row", "event_polarity") if n in self.signature.members]
        if self.config.protocol.request_has_polarity:
            fields.remove("event_polarity")
            self._request_by_polarity(m, setup, ack_sync, request)
        else:
            m.d.comb += self.aer_req.eq(request)
            with m.If(setup):
                m.d.sync += request.eq(1)
            with m.Elif(ack_sync):
                m.d.sync += request.eq(0)

        if self.config.address_bits:
            address = Signal(self.config.address_bits)
            with m.If(self.event_valid & self.event_ready):
                m.d.sync += address.eq(Cat(getattr(self, name) for name in fields))
            m.d.comb += self.aer_addr.eq(address)
        return m

    def _request_by_polarity(self, m: Module, setup: Any, ack_sync: Any, request: Any) -> None:
        """Add a flip-flop for each request line, so that no glitches reach the asynchronous receiver."""
        on = Signal()
        with m.If(self.event_valid & self.event_ready):
            m.d.sync += on.eq(self.event_polarity)
        for port, mine in ((self.aer_req_on, on), (self.aer_req_off, ~on)):
            flop = Signal(name=f"{port.name}_flop")
            with m.If(setup):
                m.d.sync += flop.eq(mine)
            with m.Elif(ack_sync):
                m.d.sync += flop.eq(0)
            m.d.comb += port.eq(flop)
        m.d.comb += request.eq(self.aer_req_on | self.aer_req_off)


def aer_ports(config: ReadoutConfig) -> dict[str, Any]:
    """Return the ports of the four-phase link, without a zero-width address."""
    address = {"aer_addr": Out(config.address_bits)} if config.address_bits else {}
    return {name: Out(1) for name in config.protocol.requests} | {"aer_ack": In(1)} | address


def receiver(config: ReadoutConfig) -> str:
    """Return a receiver of the delivered testbench, which also checks that the address is stable."""
    requests = config.protocol.requests
    address = ["aer_addr"] if config.address_bits else []
    event = joined([*requests[: len(requests) - 1], *address])
    text = f"""\
  // The receiver: ACK follows each edge of the request {ACK_EIGHTHS / 8:g} clocks later.
  wire request = {" | ".join(requests)};
  reg request_before = 1'b0;
  always @(request) #{ACK_EIGHTHS} aer_ack = request;
  always @(posedge clk)
    if (running) begin
      request_before <= request;
      if (request && !request_before) check(clock - 1, {event});
    end
"""
    if address:
        text += f"""\
  reg [{config.address_bits - 1}:0] address_before;
  always @(posedge clk) begin
    address_before <= aer_addr;
    if (running && (request || aer_ack) && aer_addr !== address_before) fail("the address changes");
  end
"""
    return text


def _hardware(requests: dict[str, str]) -> Hardware:
    """Return the hardware of a link with given requests and their meanings."""
    address = "{address_bits}; stable from one clock before a request rises until aer_ack has fallen"
    meanings = requests | {"aer_ack": "acknowledge, asynchronous", "aer_addr": address}
    return Hardware(aer_ports, meanings, receiver, FourPhaseLink, ("aer_ack",))


FOUR_PHASE = _hardware({"aer_req": "request, four-phase"})
DUAL = _hardware(
    {
        "aer_req_on": "request of an ON event, four-phase; never high beside aer_req_off",
        "aer_req_off": "request of an OFF event, four-phase",
    }
)
