"""Test pattern generator; its requests replace those of the array."""

from typing import Any

from amaranth.hdl import Cat, Const, Module, Mux, Signal
from amaranth.lib.wiring import In, Out

from eskin.model.config import ReadoutConfig
from eskin.model.registers.description import registers
from eskin.rtl.block import Block

REGISTER = "test"


def fields(config: ReadoutConfig) -> dict[str, int]:
    """Return the used fields of the test pattern register with their bits."""
    (register,) = (register for register in registers(config) if register.name == REGISTER)
    return {field.name: field.bits for field in register.fields if field.bits}


class TestPattern(Block[ReadoutConfig]):
    """Generator of requests for one taxel repeatedly, or for all taxels in turn.

    A request rises ``2**interval`` clocks after the previous request, or later, when the previous request has been
    taken. A restart withdraws a waiting request, as a mask does.

    Attributes
    ----------
    mode, on, turns, interval, row, column : In
        The fields of the register ``test``.
    restart : In(1)
        The register has just been written, or everything is cleared.
    granted : In(rows)
        The row (one-hot) whose requests are taken in this clock.
    testing : Out(1)
        The pattern replaces the array.
    row_request : Out(rows)
        The row of the request, one-hot; 0 without a request.
    column_request, column_polarity : Out(columns)
        Column of the request, one-hot, and its polarity in this bit.
    """

    __test__ = False  # not a class of tests
    module_name = "eskin_pattern"

    def __init__(self, config: ReadoutConfig) -> None:
        super().__init__(
            config,
            {
                **{name: In(width) for name, width in fields(config).items()},
                "restart": In(1),
                "granted": In(config.rows),
                "testing": Out(1),
                "row_request": Out(config.rows),
                "column_request": Out(config.columns),
                "column_polarity": Out(config.columns) if config.has_polarity else None,
            },
        )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        config = self.config
        request, taken, rises = (Signal(name=name) for name in ("request", "taken", "rises"))
        count = Signal((1 << len(self.interval)) - 1)
        row, column = Signal(range(config.rows), name="at_row"), Signal(range(config.columns), name="at_column")
        m.d.comb += [
            self.testing.eq(self.mode != 0),
            self.row_request.eq(self._one_hot(row, config.rows) & (request & ~self.restart).replicate(config.rows)),
            self.column_request.eq(self._one_hot(column, config.columns)),
            taken.eq((self.row_request & self.granted).any()),
            rises.eq(self.testing & ~count.any() & (~request | taken)),
        ]
        with m.If(self.restart | rises | taken):
            m.d.sync += request.eq(rises & ~self.restart)
        gap = (Const(1, 1) << self.interval)[: len(count)] - 1
        with m.If(self.restart | rises | count.any()):
            # Only the bits of the gap count: a higher bit, set by an upset, would delay the pattern for long.
            m.d.sync += count.eq(Mux(self.restart, 0, Mux(rises, gap, (count - 1) & gap))[: len(count)])

        # The place advances with every taken request of a round.
        last_column, last, goes_on = (Signal(name=name) for name in ("last_column", "last", "goes_on"))
        m.d.comb += [
            last_column.eq(self.column_request[-1]),
            last.eq(self.mode[0] | (last_column & self._one_hot(row, config.rows)[-1])),
            goes_on.eq(taken & self.mode[1]),
        ]
        for place, first, steps in (("column", column, goes_on), ("row", row, goes_on & last_column)):
            if len(first):
                end = last_column if place == "column" else last
                with m.If(self.restart | steps):
                    following = Mux(end, 0, first + 1)
                    m.d.sync += first.eq(Mux(self.restart, getattr(self, place), following)[: len(first)])
        if config.has_polarity:
            sign = Signal(init=1)
            with m.If(self.restart | (taken & last & self.turns)):
                m.d.sync += sign.eq(Mux(self.restart, self.on, ~sign))
            m.d.comb += self.column_polarity.eq(self.column_request & sign.replicate(config.columns))
        return m

    def _one_hot(self, place: Signal, count: int) -> Any:
        """Return a position as a one-hot signal.

        A place behind the last counts as the last, so that a request has a line even after an upset.
        """
        lines = Cat(place == index for index in range(count - 1))
        return Cat(lines, place >= count - 1) if len(place) else Const(1, 1)
