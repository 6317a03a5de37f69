"""Row-column arbiter: round robin over rows, all requests of a row latched at once, one event per clock."""

from typing import Any

from amaranth.hdl import Cat, Const, Module, Mux, Signal
from amaranth.lib.wiring import In, Out

from eskin.model.config import ReadoutConfig
from eskin.rtl.block import Block
from eskin.rtl.logic import encode, exclusive_prefix_or, or_tree


class Arbiter(Block[ReadoutConfig]):
    """Word-serial arbiter with a burst latch.

    The arbiter grants a row in the clock in which the latch is empty or sends its last event. So it loses no clock
    between rows or between bursts of a row. ``event_valid`` and the payload come from the latch alone.

    Latency: request at clock t, event at t + 1. Throughput: one event per clock. A request leaves within
    (rows + 1) * columns accepted events after it was raised.

    Attributes
    ----------
    row_request : In(rows)
        Rows with a request.
    column_request, column_polarity : In(rows * columns)
        Column lines of all rows, row 0 in the least significant bits; 0 for rows that are not selected.
    select : Out(rows)
        The row (one-hot) that drives the column lines: the next one to be granted.
    granted : Out(rows)
        The row (one-hot) whose requests are latched at the end of this clock.
    event_valid, event_ready, event_row, event_col, event_polarity
        The stream of address events; zero-width fields are absent.
    awake : Out(1)
        Low in a clock at whose end no register of the arbiter changes: its clock may be stopped.
    """

    module_name = "eskin_arbiter"

    def __init__(self, config: ReadoutConfig) -> None:
        bipolar = config.has_polarity
        super().__init__(
            config,
            {
                "row_request": In(config.rows),
                "column_request": In(config.taxels),
                "column_polarity": In(config.taxels) if bipolar else None,
                "select": Out(config.rows),
                "granted": Out(config.rows),
                **event_ports(config, Out),
                "awake": Out(1),
            },
        )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        rows, columns = self.config.rows, self.config.columns

        # The first requesting row behind the last granted row, else the first of all. The prefix OR gives both the
        # one-hot choice and, as a thermometer, the rows behind it: the mask of the next round.
        behind = Signal(rows - 1)
        candidates = Signal(rows)
        load = Signal()
        takes = Signal()
        later = Signal(rows - 1)
        thermometer = Signal(rows)
        m.d.comb += [
            later.eq(self.row_request[1:] & behind),
            thermometer.eq(Cat(exclusive_prefix_or(candidates, m, "candidates"))),
            candidates.eq(Mux(later.any(), Cat(Const(0, 1), later), self.row_request)),
            self.select.eq(candidates & ~thermometer),
            self.granted.eq(self.select & load.replicate(rows)),
            takes.eq(load & self.row_request.any()),
            self.awake.eq(takes | (self.event_valid & self.event_ready)),
        ]
        with m.If(takes):
            m.d.sync += behind.eq(thermometer[1:])

        # The burst latch, drained in rising column order.
        waiting = Signal(columns)
        waiting_below = Signal(columns)
        first = Signal(columns)
        rest = Signal(columns)
        m.d.comb += [
            waiting_below.eq(Cat(exclusive_prefix_or(waiting, m, "waiting"))),
            first.eq(waiting & ~waiting_below),
            rest.eq(waiting & ~first),
            self.event_valid.eq(waiting.any()),
            load.eq(~waiting.any() | (self.event_ready & ~rest.any())),
        ]
        lines = [self.column_request.word_select(row, columns) for row in range(rows)]
        with m.If(takes):
            m.d.sync += waiting.eq(or_tree(lines))
        with m.Elif(self.event_ready):
            m.d.sync += waiting.eq(rest)

        # The payload.
        if self.config.row_bits:
            row = Signal(self.config.row_bits)
            with m.If(takes):
                m.d.sync += row.eq(encode(self.select))
            m.d.comb += self.event_row.eq(row)
        if self.config.column_bits:
            m.d.comb += self.event_col.eq(encode(first))
        if self.config.has_polarity:
            polarity = Signal(columns)
            lines = [self.column_polarity.word_select(row, columns) for row in range(rows)]
            with m.If(takes):
                m.d.sync += polarity.eq(or_tree(lines))
            m.d.comb += self.event_polarity.eq((polarity & first).any())
        return m


def event_ports(config: ReadoutConfig, flow: Any) -> dict[str, Any]:
    """Return the ports of an event stream, without empty fields; ``flow`` is Out in the source, else In.

    Not a ``stream.Signature``: that makes one packed port ``event__payload``, and the specification (section 4)
    promises ``event_row``, ``event_col`` and ``event_polarity``, each only where it has bits.
    """
    back = In if flow is Out else Out
    ports = {"event_valid": flow(1), "event_ready": back(1)}
    if config.row_bits:
        ports["event_row"] = flow(config.row_bits)
    if config.column_bits:
        ports["event_col"] = flow(config.column_bits)
    if config.has_polarity:
        ports["event_polarity"] = flow(1)
    return ports
