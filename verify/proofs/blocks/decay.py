"""Properties of the decay ticks: every row leaks once per period, at its phase."""

from collections.abc import Callable
from typing import Any, ClassVar

from amaranth.hdl import Const, Module, Mux, Signal

from eskin.model.config import ReadoutConfig
from eskin.model.decay import decay_phases
from eskin.rtl.decay import DecayTicks
from eskin.rtl.registers.decay import SettableDecayTicks
from eskin.verify.proofs.checker import Checker, Promises, before, pick


class DecayChecker(Checker[ReadoutConfig]):
    """Checker of decay ticks with a fixed period.

    ``watch`` is any row, for good.
    """

    block: ClassVar[type[Any]] = DecayTicks

    def constants(self, config: ReadoutConfig) -> dict[str, int]:
        return {"watch": config.rows}

    def check(self, m: Module) -> Promises:
        self._surroundings(m)
        period, restart = self._period()
        rows, most = self.config.rows, self.config.leak_period
        ticks, since = Signal(range(most)), Signal(range(most + 1))
        leaks = self._of_row()
        counts = self.tick & ~restart
        self.keep(m, ticks, restart, self.tick, Mux(ticks + 1 >= period, 0, ticks + 1))
        self.keep(m, since, restart, self.tick, Mux(leaks, 1, since + (since != 0)))
        phases = [(row * period) // rows for row in range(rows)]
        phase = pick(phases, self.watch)
        real = self.watch < rows
        yield "only_on_ticks", counts | ~leaks, leaks
        yield "at_its_phase", ~real | (leaks == (counts & (ticks == phase))), leaks & ((phase != 0) | (since != 0))
        again = leaks & (since != 0)
        yield "once_a_period", (~again | (since == period)) & (restart | (since <= period)), again

    def _surroundings(self, m: Module) -> None:
        """Define the assumptions."""

    def _period(self) -> tuple[Any, Any]:
        """Return the period, and whether it restarts in this clock."""
        return Const(self.config.leak_period), Const(0)

    def _of_row(self) -> Any:
        """Return whether the watched row leaks."""
        found = sorted(set(decay_phases(self.config).tolist()))
        lines = [self.decay[found.index(phase)] for phase in decay_phases(self.config)]
        return pick(lines, self.watch)


class SettableDecayChecker(DecayChecker):
    """Checker of decay ticks with a period set by a host."""

    block = SettableDecayTicks
    assumptions: ClassVar = {"period_in_range": "a period is at least the number of rows, and changes with a restart"}

    def drive(self, m: Module, free: Callable[[str, int], Signal]) -> set[str]:
        """Drive the period, which changes only together with a restart."""
        low, high = self.config.rows, self.config.leak_period
        begins, new = free("restart", 1), free("period", len(self.period))
        kept = Signal(len(self.period), init=high, name="kept_period")
        with m.If(begins):
            m.d.sync += kept.eq(Mux((new < low) | (new > high), high, new))
        m.d.sync += self.restart.eq(begins)
        m.d.comb += self.period.eq(kept)
        return {"restart", "period"}

    def _surroundings(self, m: Module) -> None:
        old, known = before(m, self.period, "period"), before(m, Const(1, 1), "known")
        kept = ~known | self.restart | (self.period == old)
        self.suppose(m, "period_in_range", (self.period >= self.config.rows) & kept)

    def _period(self) -> tuple[Any, Any]:
        return self.period, self.restart

    def _of_row(self) -> Any:
        return pick(self.decay, self.watch)
