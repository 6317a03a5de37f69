"""The closing-window counter of a CW-LCS taxel."""

from __future__ import annotations

from typing import Any

from amaranth.hdl import Module, Mux, Signal
from amaranth.lib.wiring import In, Out

from model.config import ReadoutConfig
from rtl.block import Block


class ClosingWindow(Block[ReadoutConfig]):
    """Half-width of one CW-LCS taxel's window: narrower after every ``window_period`` quiet sample ticks.

    Attributes
    ----------
    enable : In(1)
        Low holds the window in its reset state.
    free : In(1)
        Low freezes the window (the taxel's request waits).
    tick : In(1)
        Sample tick.
    fired : In(1)
        The taxel raises an event in this clock: the window opens fully.
    half_width : Out(closing_levels_log2 + 1)
        In closing steps, from 2**closing_levels_log2 (D) down to 1.
    """

    module_name = "eskin_window"

    def __init__(self, config: ReadoutConfig) -> None:
        super().__init__(
            config,
            {
                "enable": In(1),
                "free": In(1),
                "tick": In(1),
                "fired": In(1),
                "half_width": Out(config.closing_levels_log2 + 1),
            },
        )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        levels = 1 << self.config.closing_levels_log2
        # What drives a DAC leaves a flop: for analog comparators the half-width itself is the counter. Otherwise it is
        # the closing steps taken, which are a flop less.
        if self.config.frontend == "analog":
            window = Signal(len(self.half_width), init=levels, name="window")
            m.d.comb += self.half_width.eq(window)
            narrowest, narrower = 1, window - 1
        else:
            window = Signal(range(levels), name="closed")
            m.d.comb += self.half_width.eq(levels - window)
            narrowest, narrower = levels - 1, window + 1
        quiet = Signal(range(self.config.window_period))
        last = Signal()
        m.d.comb += last.eq(quiet == self.config.window_period - 1)
        with m.If(~self.enable | (self.free & self.fired)):
            m.d.sync += [window.eq(window.init), quiet.eq(0)]
        with m.Elif(self.free & self.tick):
            m.d.sync += quiet.eq(Mux(last, 0, (quiet + 1)[: len(quiet)]))
            with m.If(last & (window != narrowest)):
                m.d.sync += window.eq(narrower[: len(window)])
        return m
