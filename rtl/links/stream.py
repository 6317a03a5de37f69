"""The valid/ready stream: the arbiter's ports."""

from amaranth.lib.wiring import Out

from eskin.model.config import ReadoutConfig
from eskin.rtl.arbiter import event_ports
from eskin.rtl.links.link import READY, Hardware, joined


def receiver(config: ReadoutConfig) -> str:
    """Return a sink of the delivered testbench that is not always ready."""
    ports = event_ports(config, Out)
    event = joined([name for name in ("event_polarity", "event_row", "event_col") if name in ports])
    return f"""\
  // The sink is not ready in one of {len(READY)} clocks.
  always @(posedge clk) begin
    event_ready <= !running || (clock + 1) % {len(READY)} != {READY.index(0)};
    if (running && event_valid && event_ready) check(clock, {event});
  end
"""


STREAM = Hardware(
    lambda config: event_ports(config, Out),
    {
        "event_valid": "an address event is offered",
        "event_ready": "the sink takes the event at this edge",
        "event_row": "row of the event",
        "event_col": "column of the event",
        "event_polarity": "1 is ON, 0 is OFF",
    },
    receiver,
)
