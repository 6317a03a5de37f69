"""Properties of the test pattern: order of requests, taxel, polarity and interval."""

from collections.abc import Callable
from typing import Any, ClassVar

from amaranth.hdl import Cat, Const, Module, Mux, Signal
from amaranth.lib.wiring import In

from eskin.model.config import ReadoutConfig
from eskin.model.registers.pattern import ALL
from eskin.rtl.logic import encode
from eskin.rtl.registers.pattern import TestPattern, fields
from eskin.verify.proofs.checker import Checker, Promises, at_most_one, before, implies


class PatternChecker(Checker[ReadoutConfig]):
    """Checker of the test pattern; its register and the granted row are free."""

    block = TestPattern
    only: ClassVar = {"polarity_turns": lambda config: config.has_polarity}

    def inner(self, config: ReadoutConfig) -> dict[str, Any]:
        sides = {"at_row": config.rows, "at_column": config.columns}
        places = {name: In((side - 1).bit_length()) for name, side in sides.items() if side > 1}
        return {**places, "count": In((1 << dict(fields(config))["interval"]) - 1)}

    def drive(self, m: Module, free: Callable[[str, int], Signal]) -> set[str]:
        """Drive the register, which changes only together with a restart."""
        names = {*fields(self.config), "restart"}
        begins = free("restart", 1)
        m.d.sync += self.restart.eq(begins)
        for name, width in fields(self.config).items():
            kept = Signal(width, init=1 if name == "on" else 0, name=f"kept_{name}")
            new = free(name, width)
            with m.If(begins):
                m.d.sync += kept.eq(new & ~(new.all().replicate(width)) if name == "mode" else new)
            m.d.comb += getattr(self, name).eq(kept)
        return names

    def check(self, m: Module) -> Promises:
        config = self.config
        asks, taken = self.row_request.any(), (self.row_request & self.granted).any()
        taxel = Cat(encode(self.column_request), encode(self.row_request))
        place = Cat(getattr(self, name) for name in ("at_column", "at_row") if self.has(name))
        runs = (self.mode != 0) & ~self.restart
        first = Cat(
            getattr(self, name)[: (side - 1).bit_length()]
            for name, side in (("column", config.columns), ("row", config.rows))
            if side > 1
        )
        quiet = (self.mode == 0) | self.restart
        alone = at_most_one(self.row_request) & at_most_one(self.column_request)
        yield "one_request", implies(asks, ~quiet & alone & self.column_request.any()), asks
        waited = before(m, asks & ~taken, "waited") & ~self.restart
        sign = (self.column_polarity & self.column_request).any() if config.has_polarity else Const(0)
        request = Cat(taxel, sign)
        same = request == before(m, request, "request")
        yield "waits_for_grant", implies(waited, asks & same), waited & (taxel != 0)

        # What comes next: kept by the last request that was taken, in arrays whose sides are powers of two.
        begun, due, due_sign = Signal(), Signal(len(taxel)), Signal(init=1)
        last = taxel == config.taxels - 1
        with m.If(self.restart):
            m.d.sync += begun.eq(0)
        with m.Elif(taken):
            m.d.sync += [begun.eq(1), due.eq(Mux(self.mode == ALL, (taxel + 1)[: len(taxel)], taxel))]
        right = implies(runs & ~begun, place == first) & implies(asks & ~begun, taxel == first)
        yield "starts_there", right, asks & ~begun & (first != 0)
        right = implies(runs & begun, place == due) & implies(asks & begun, taxel == due)
        yield "in_turn", right, asks & begun & (due == 0) & (self.mode == ALL)
        if config.has_polarity:
            turns = taken & self.turns & ((self.mode != ALL) | last)
            self.keep(m, due_sign, self.restart, turns, ~due_sign, start=self.on)
            yield "polarity_turns", implies(asks, sign == due_sign), asks & (due_sign != self.on)
        yield from self._pace(m, asks, taken, quiet)

    def _pace(self, m: Module, asks: Any, taken: Any, quiet: Any) -> Promises:
        """Count the clocks since a request rose."""
        old, took = before(m, asks, "asks"), before(m, taken, "taken")
        fresh = asks & (~old | took)
        idle = self.keep(m, Signal(init=1, name="idle"), quiet, fresh, 0, start=1)
        since = self.count_to(m, (1 << 17) - 1, quiet | fresh, 1, start=~quiet)
        early = ~idle & (since < (Const(1, 1) << self.interval))
        late = ~quiet & ~asks & ~idle & (since >= (Const(1, 1) << self.interval)) & ~early
        started = before(m, ~quiet & (self.mode != 0), "started")
        right = implies(fresh, ~early) & ~late & implies(started & idle & ~quiet, asks)
        # The counter of the block, which says when the next one may rise.
        left = (Const(1, 1) << self.interval)[:16] - 1
        first, so_far = idle & ~fresh, Mux(fresh, 0, since)
        right &= quiet | Mux(self.count != 0, ~first & (self.count + so_far == left), first | (so_far >= left))
        yield "at_its_pace", right, fresh & ~idle & (self.interval == 2)
