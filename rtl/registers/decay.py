"""Decay tick counter of the N-LCS array with a period set by a host."""

from typing import Any

from amaranth.hdl import Cat, Module, Mux, Signal
from amaranth.lib.wiring import In, Out

from eskin.model.config import ReadoutConfig
from eskin.rtl.block import Block


class SettableDecayTicks(Block[ReadoutConfig]):
    """Counter that times the leak of row r: sample ticks j with j mod period = floor(r * period / rows).

    Row r leaks at tick j where r * period lies in j * rows .. (j + 1) * rows - 1. The counter holds the distance to the
    next row, r * period - j * rows, so the hardware divides nothing. A period is never below the number of rows, so one
    row leaks at a time.

    Attributes
    ----------
    tick : In(1)
        Sample tick.
    period : In
        Sample ticks from one leak of a row to its next.
    restart : In(1)
        The next tick is tick 0; in this clock no row leaks.
    decay : Out(rows)
        High in the clock of a sample tick in which the row leaks.
    """

    module_name = "eskin_decay"

    def __init__(self, config: ReadoutConfig) -> None:
        bits = config.leak_period.bit_length()
        super().__init__(config, {"tick": In(1), "period": In(bits), "restart": In(1), "decay": Out(config.rows)})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        rows = self.config.rows
        away = Signal(len(self.period))
        due = Signal()
        m.d.comb += due.eq(self.tick & ~self.restart & (away < rows))
        with m.If(self.tick | self.restart):
            further = away + Mux(due, self.period, 0) - rows
            m.d.sync += away.eq(Mux(self.restart, 0, further[: len(away)]))
        if rows == 1:
            m.d.comb += self.decay.eq(due)
            return m
        line = Signal(rows, init=1)
        with m.If(due | self.restart):  # after a bit flip, a lost bit returns, and a second bit disappears
            m.d.sync += line.eq(Mux(self.restart, 1, Cat(~line[:-1].any(), line[:-1])))
        m.d.comb += self.decay.eq(line & due.replicate(rows))
        return m
