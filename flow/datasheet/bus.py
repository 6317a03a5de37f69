"""Datasheet of a readout behind AXI, from the golden model of its stream."""

from eskin.flow.datasheet.sheet import Picture, Sheet, Wave
from eskin.flow.datasheet.waves import latencies
from eskin.model.bus.axi_lite import ACCESS_CLOCKS, BUS_ADDRESS_BITS
from eskin.model.bus.axi_stream import AxiStream, Event
from eskin.model.bus.config import BusConfig

CLOCKS = 14
STALL = range(6, 8)
"""Clocks in which the sink takes nothing."""
BEHIND = 2
"""Clocks from an event of the arbiter to ``TVALID``."""


def waves(config: BusConfig) -> list[Wave]:
    """Return the waveforms of two packets: at most three events of row 0, and one event of the last row."""
    readout, stream = config.readout, AxiStream(config)
    events = [Event(column, 0, int(readout.has_polarity)) for column in range(min(3, readout.columns))]
    left = [*events, Event(0, readout.rows - 1, 0)]
    found = []
    for clock in range(CLOCKS):
        event = left[0] if left and clock else None
        tready, offered = clock not in STALL, stream.offered
        ready = stream.ready(tready)
        data, last = offered or (None, None)
        found.append((event is not None, ready, offered is not None, tready, data, last))
        stream.clock(event, tready)
        if event is not None and ready:
            left.pop(0)
    names = ("event_valid", "event_ready", "m_axis_tvalid", "m_axis_tready", "m_axis_tdata", "m_axis_tlast")
    columns = [tuple(None if value is None else int(value) for value in column) for column in zip(*found, strict=True)]
    return [Wave(name, values, name == "m_axis_tdata") for name, values in zip(names, columns, strict=True)]


def sheet_of(config: BusConfig) -> Sheet:
    """Return the datasheet of a readout behind AXI."""
    readout = config.readout
    access = [("read or write of a register to its response, no other access", ACCESS_CLOCKS)]
    values = {
        "readout": readout,
        "latencies": [
            ("sample tick to `m_axis_tvalid`, array idle", latencies(readout).latency + BEHIND),
            ("event of the arbiter to `m_axis_tvalid`, sink always ready", BEHIND),
            ("from one event to the next", 1),
            *(access if readout.registers != "none" else []),
        ],
        "stall": STALL,
        "window_kb": (1 << BUS_ADDRESS_BITS) // 1024,
        "resets": {
            "sync": "`aresetn` is active low and sampled at the rising edge of `aclk`.",
            "async": "`aresetn` is active low and asynchronous at every flop. Release it synchronously to `aclk`.",
        },
    }
    what = f"{readout.rows} x {readout.columns} taxels, {readout.encoding}, {readout.resolution} b, behind AXI"
    return Sheet(config, what, "bus.md", values, (Picture("stream", "Two packets of events", waves(config)),))
