"""Closing-window counter of a CW-LCS taxel."""

from typing import Any

from amaranth.hdl import Module, Mux, Signal
from amaranth.lib.wiring import In, Out

from eskin.model.config import ReadoutConfig
from eskin.rtl.block import Block


class ClosingWindow(Block[ReadoutConfig]):
    """Half-width counter of a CW-LCS window, which closes by a step after ``window_period`` ticks without an event.

    Attributes
    ----------
    open : In(1)
        The taxel raises an event in this clock, or is masked: the window opens fully.
    tick : In(1)
        Sample tick that counts: one of an enabled taxel whose request does not wait.
    half_width : Out(closing_levels_log2 + 1)
        In closing steps, from 2**closing_levels_log2 (D) down to 1.
    period : In
        Quiet ticks for a step, where a host sets them (``registers="spi"``).
    narrows : Out(1)
        The window closes by a step at the end of this clock, unless ``open`` is high (analog front end that
        decides in every clock).
    closed : Out(1)
        The window is as narrow as it gets: it stands still, and its counter too, until it is opened.
    """

    module_name = "eskin_window"

    def __init__(self, config: ReadoutConfig) -> None:
        super().__init__(
            config,
            {
                "open": In(1),
                "tick": In(1),
                "period": None if config.registers == "none" else In(config.window_period.bit_length()),
                "half_width": Out(config.closing_levels_log2 + 1),
                "narrows": Out(1) if config.asks_between_ticks else None,
                "closed": Out(1),
            },
        )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        levels = 1 << self.config.closing_levels_log2
        # A DAC must be driven by flops: for analog comparators the half-width itself is the counter. Otherwise the
        # counter is the number of closing steps, which takes a flop less.
        quiet = Signal(range(self.config.window_period))
        last = Signal()
        m.d.comb += last.eq(
            quiet == self.config.window_period - 1 if self.config.registers == "none" else quiet + 1 >= self.period
        )
        if self.config.frontend == "analog":
            window = Signal(len(self.half_width), init=levels, name="window")
            narrower = window - last
            m.d.comb += [self.half_width.eq(window), self.closed.eq(window == 1)]
            if self.config.asks_between_ticks:
                m.d.comb += self.narrows.eq(self.tick & last & ~self.closed)
        else:
            window = Signal(range(levels), name="steps")
            narrower = window + last
            m.d.comb += [self.half_width.eq(levels - window), self.closed.eq(window == levels - 1)]
        # One enable for both registers, low in a closed window.
        with m.If(self.open | (self.tick & ~self.closed)):
            m.d.sync += [
                window.eq(Mux(self.open, window.init, narrower[: len(window)])),
                quiet.eq(Mux(self.open | last, 0, (quiet + 1)[: len(quiet)])),
            ]
        return m
