"""The closing window of CW-LCS."""

from __future__ import annotations

from typing import Any

from amaranth.hdl import Module, Mux, Signal

from eskin.model.config import ReadoutConfig
from eskin.rtl.window import ClosingWindow
from eskin.verify.proofs.checker import Checker, Property, before, implies


class WindowChecker(Checker[ReadoutConfig]):
    """Watches the window of one taxel."""

    block = ClosingWindow
    properties = (
        Property("within_bounds", "the half-width is never below one closing step and never above D"),
        Property("opens_fully", "after it is told to open, the half-width is D"),
        Property("says_closed", "it says that it is closed exactly where the half-width is one step"),
        Property(
            "closes_step_by_step", "otherwise the half-width holds still or loses one closing step, on a sample tick"
        ),
        Property(
            "closes_on_time", "it loses one with every window_period-th quiet tick, down to one step, and never else"
        ),
    )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        levels, period = 1 << self.config.closing_levels_log2, self.config.window_period
        width, old = self.half_width, Signal(len(self.half_width), init=levels)
        m.d.sync += old.eq(width)
        opened = before(m, self.open, "opened")
        ticked = before(m, self.tick & ~self.open, "ticked")
        self.promise(m, "within_bounds", (width >= 1) & (width <= levels), width == 1)
        self.promise(m, "opens_fully", implies(opened, width == levels), opened & (old == 1))
        self.promise(m, "says_closed", self.closed == (width == 1), self.closed)
        closes = (width + 1 == old) & ticked
        self.promise(m, "closes_step_by_step", opened | (width == old) | closes, closes)
        # Quiet ticks since the window was opened, up to those that close it for good.
        quiet = Signal(range(period * levels + 1))
        with m.If(self.open):
            m.d.sync += quiet.eq(0)
        with m.Elif(self.tick & (quiet != period * (levels - 1))):
            m.d.sync += quiet.eq(quiet + 1)
        due: Any = levels - 1
        for step in reversed(range(levels - 1)):
            due = Mux(quiet < period * (step + 1), step, due)
        self.promise(m, "closes_on_time", width == levels - due, quiet == period * (levels - 1))
        return self.finish(m)
