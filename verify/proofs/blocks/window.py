"""Properties of the closing window of CW-LCS."""

from collections.abc import Callable
from typing import Any, ClassVar

from amaranth.hdl import Module, Mux, Signal

from eskin.model.config import ReadoutConfig
from eskin.rtl.window import ClosingWindow
from eskin.verify.proofs.checker import Checker, Promises, before, implies


class WindowChecker(Checker[ReadoutConfig]):
    """Checker of one taxel's window; the period set by a host is free."""

    block = ClosingWindow
    only: ClassVar = {"says_narrows": lambda config: config.asks_between_ticks}

    def drive(self, m: Module, free: Callable[[str, int], Signal]) -> set[str]:
        """Drive the period with any value in range."""
        if self.config.registers == "none":
            return set()
        value, most = free("period", len(self.period)), self.config.window_period
        m.d.comb += self.period.eq(Mux((value == 0) | (value > most), most, value))
        return {"period"}

    def check(self, m: Module) -> Promises:
        levels, period = 1 << self.config.closing_levels_log2, self.config.window_period
        width, old = self.half_width, Signal(len(self.half_width), init=levels)
        m.d.sync += old.eq(width)
        opened = before(m, self.open, "opened")
        ticked = before(m, self.tick & ~self.open, "ticked")
        yield "within_bounds", (width >= 1) & (width <= levels), width == 1
        yield "opens_fully", implies(opened, width == levels), opened & (old == 1)
        yield "says_closed", self.closed == (width == 1), self.closed
        closes = (width + 1 == old) & ticked
        yield "closes_step_by_step", opened | (width == old) | closes, closes
        narrows = before(m, self.port("narrows") & ~self.open, "narrows")
        yield "says_narrows", (width < old) == narrows, narrows
        due, done = self._set(m, levels) if self.config.registers != "none" else self._built(m, levels, period)
        yield "closes_on_time", width == levels - due, done

    def _built(self, m: Module, levels: int, period: int) -> tuple[Any, Any]:
        """Return the number of closing steps that must have happened, and whether the window is closed."""
        quiet = self.count_to(m, period * (levels - 1), self.open, self.tick)
        due: Any = levels - 1
        for step in reversed(range(levels - 1)):
            due = Mux(quiet < period * (step + 1), step, due)
        return due, quiet == period * (levels - 1)

    def _set(self, m: Module, levels: int) -> tuple[Any, Any]:
        """Return the number of closing steps that must have happened, for a period that a host sets."""
        quiet, due = Signal(range(self.config.window_period)), Signal(range(levels))
        closes = (quiet + 1 >= self.period) & (due != levels - 1)
        counts = self.tick & (due != levels - 1)
        self.keep(m, quiet, self.open, counts, Mux(closes, 0, quiet + 1))
        self.keep(m, due, self.open, counts, due + closes)
        return due, due == levels - 1
