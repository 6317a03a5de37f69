"""Serial line with 8 bits, no parity and one stop bit.

Own code: the package of that name on the registry (amaranth-stdio) is an empty place.
"""

from typing import Any

from amaranth.hdl import Cat, Const, Module, Signal
from amaranth.lib.cdc import FFSynchronizer
from amaranth.lib.wiring import Component, In, Out

from eskin.board.config import SerialConfig


class UartReceiver(Component):
    """UART receiver that samples each bit of the asynchronous line in its middle; ``valid`` is high for one clock."""

    def __init__(self, config: SerialConfig) -> None:
        self.config = config
        super().__init__({"line": In(1), "valid": Out(1), "data": Out(8)})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        line = Signal(init=1)
        m.submodules.synchroniser = FFSynchronizer(self.line, line, init=1)
        whole, one = self.config.clocks_per_bit.as_integer_ratio()  # a bit lasts whole / one clocks
        count, bit = Signal(range(whole)), Signal(range(10))
        m.d.sync += self.valid.eq(0)
        with m.FSM():
            with m.State("REST"), m.If(~line):
                m.d.sync += [count.eq(whole // 2 - one), bit.eq(0)]
                m.next = "BITS"
            with m.State("BITS"):
                m.d.sync += count.eq(count - one)
                with m.If(count < one):
                    m.d.sync += [count.eq(count + (whole - one)), bit.eq(bit + 1)]
                    with m.If(bit == 0), m.If(line):  # no start bit, only noise
                        m.next = "REST"
                    with m.Elif(bit == 9):
                        m.d.sync += self.valid.eq(1)
                        m.next = "STOP"
                    with m.Else():
                        m.d.sync += self.data.eq(Cat(self.data[1:], line))
            with m.State("STOP"), m.If(line):  # a line that stays low is no byte
                m.next = "REST"
        return m


class UartSender(Component):
    """UART sender without gaps between bytes."""

    def __init__(self, config: SerialConfig) -> None:
        self.config = config
        super().__init__({"line": Out(1, init=1), "valid": In(1), "ready": Out(1), "data": In(8)})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        whole, one = self.config.clocks_per_bit.as_integer_ratio()  # a bit lasts whole / one clocks
        count, left = Signal(range(whole)), Signal(range(11))
        bits = Signal(9)
        m.d.comb += self.ready.eq(left == 0)
        with m.If(self.ready & self.valid):
            m.d.sync += [self.line.eq(0), bits.eq(Cat(self.data, Const(1, 1))), left.eq(10), count.eq(whole - one)]
        with m.Elif(~self.ready & (count < one)):
            m.d.sync += [
                self.line.eq(bits[0]),
                bits.eq(Cat(bits[1:], Const(1, 1))),
                left.eq(left - 1),
                count.eq(count + (whole - one)),
            ]
        with m.Else():
            m.d.sync += count.eq(count - one)
        return m
