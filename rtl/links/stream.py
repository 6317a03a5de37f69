"""The valid/ready stream: the arbiter's ports."""

from amaranth.lib.wiring import Out

from eskin.rtl.arbiter import event_ports
from eskin.rtl.links.link import Hardware

STREAM = Hardware(
    lambda config: event_ports(config, Out),
    {
        "event_valid": "an address event is offered",
        "event_ready": "the sink takes the event at this edge",
        "event_row": "row of the event",
        "event_col": "column of the event",
        "event_polarity": "1 is ON, 0 is OFF",
    },
)
