"""Properties of the arbiter: grants, transferred events, and longest wait."""

from collections.abc import Callable
from typing import Any, ClassVar

from amaranth.hdl import Cat, Module, Signal
from amaranth.lib.wiring import In

from eskin.model.config import ReadoutConfig
from eskin.rtl.arbiter import Arbiter
from eskin.verify.proofs.checker import Checker, Promises, at_most_one, before, cyclic, implies, pick, within


class ArbiterChecker(Checker[ReadoutConfig]):
    """Checker of the arbiter and of the requests of all taxels.

    ``request`` and ``polarity`` have a bit for every taxel, selected or not. ``watch`` and ``rival`` are any two
    taxels, for good.
    """

    block = Arbiter
    only: ClassVar = {
        "polarity_kept": lambda config: config.has_polarity,
        "column_order": lambda config: config.columns > 1,
        "fairness": lambda config: config.rows > 1,
    }
    assumptions: ClassVar = {
        "lines_follow_requests": "row and column lines are those of the taxels' requests, as a row drives them"
    }

    def observed(self, config: ReadoutConfig) -> dict[str, Any]:
        kinds = ("request", "polarity") if config.has_polarity else ("request",)
        return super().observed(config) | dict.fromkeys(kinds, In(config.taxels))

    def constants(self, config: ReadoutConfig) -> dict[str, int]:
        return dict.fromkeys(("watch", "rival"), config.taxels)

    def drive(self, m: Module, free: Callable[[str, int], Signal]) -> set[str]:
        """Drive the row and column lines as ``eskin.rtl.taxel.Row`` does, from arbitrary requests."""
        m.d.comb += self.request.eq(free("request", self.config.taxels))
        rows, columns = self._lines(self.request)
        m.d.comb += [self.row_request.eq(rows), self.column_request.eq(columns)]
        if self.config.has_polarity:
            m.d.comb += [
                self.polarity.eq(free("polarity", self.config.taxels)),
                self.column_polarity.eq(self._lines(self.polarity)[1]),
            ]
        return {"row_request", "column_request", "column_polarity", "request", "polarity"}

    def _lines(self, taxels: Signal) -> tuple[Any, Any]:
        """Return the row lines and the gated column lines for a bit per taxel."""
        rows, columns = self.config.rows, self.config.columns
        words = [taxels[row * columns : (row + 1) * columns] for row in range(rows)]
        gated = [word & self.select[row].replicate(columns) for row, word in enumerate(words)]
        return Cat(word.any() for word in words), Cat(gated)

    def check(self, m: Module) -> Promises:
        rows, columns = self._lines(self.request)
        follows = (self.row_request == rows) & (self.column_request == columns)
        if self.config.has_polarity:
            follows &= self.column_polarity == self._lines(self.polarity)[1]
        self.suppose(m, "lines_follow_requests", follows)
        yield from self._grants(m)
        yield from self._order(m)
        yield from self._watched(m)
        if self.config.rows > 1:
            grants = Cat(grant.replicate(self.config.columns) for grant in self.granted)
            takes, rival = (pick(self.request & grants, taxel) for taxel in (self.watch, self.rival))
            yield "fairness", *self.fair(m, takes, pick(self.request, self.rival), rival)

    def _grants(self, m: Module) -> Promises:
        asked = self.row_request.any()
        one = at_most_one(self.select) & at_most_one(self.granted) & within(self.granted, self.select)
        yield "one_hot_grant", one, self.granted.any() & asked
        yield "grant_implies_request", within(self.select | self.granted, self.row_request), self.granted.any()
        leaves = self.event_valid & self.event_ready
        yield "sleeps", self.awake == (self.granted.any() | leaves), ~self.awake & self.event_ready
        idle = ~self.event_valid & asked
        yield "idle_grants", implies(idle, self.granted.any()), idle
        asked_before = before(m, asked, "asked")
        left = before(m, self.event_valid & self.event_ready, "left")
        yield "no_bubble", implies(asked_before, self.event_valid), asked_before & left
        payload = Cat(getattr(self, n) for n in ("event_row", "event_col", "event_polarity") if self.has(n))
        yield "payload_stable", *self.unchanged(m, self.event_valid, self.event_ready, payload)

    def _order(self, m: Module) -> Promises:
        asked, granted = self.row_request.any(), self.granted.any()
        # Rows from the one behind the last granted on, in cyclic order, up to the granted one: none of them asks.
        last, jumps = cyclic(m, self.row_request, self.granted)
        wraps = granted & (self.granted <= last)
        yield "row_order", ~jumps, wraps & asked
        if self.config.columns > 1:
            row = self.port("event_row")
            goes_on = before(m, self.event_valid & self.event_ready & ~granted, "goes_on") & self.event_valid
            again = goes_on & before(m, self.event_valid, "valid")
            rises = (self.event_col > before(m, self.event_col, "column")) & (row == before(m, row, "row"))
            fresh = before(m, granted, "granted")
            yield "column_order", implies(again & ~fresh, rises), again & ~fresh

    def _watched(self, m: Module) -> Promises:
        """Track the requests of one taxel until their events leave."""
        columns = self.config.columns
        bound = (self.config.rows + 1) * columns
        requests, grants = pick(self.request, self.watch), Cat(grant.replicate(columns) for grant in self.granted)
        takes = requests & pick(grants, self.watch)
        leaves = self.event_valid & self.event_ready
        row, column = self.port("event_row"), self.port("event_col")
        named = self.event_valid & (row * self.config.columns + column == self.watch)
        mine = leaves & named
        latched = Signal()
        m.d.sync += latched.eq(takes | (latched & ~mine))
        alone = latched & ~self.row_request.any()
        yield "latched_is_offered", implies(latched, self.event_valid), alone
        # Clocks of a ready sink since the request was raised; one that is raised again is counted anew.
        clocks = self.count_to(m, bound, ~latched & ~requests | mine, self.event_ready)
        yield "leaves_in_time", clocks != bound, mine & (clocks >= columns)
        exists = ~self.event_valid | ((row < self.config.rows) & (column < self.config.columns))
        yield "address_correct", implies(named, latched) & exists, named
        yield "exactly_one_event", implies(takes & latched, mine), takes & latched

        ahead = self.count_to(m, columns, takes, leaves)
        yield "in_turn", implies(latched, ahead < columns), mine & (ahead == columns - 1)

        # Events that left since the request was raised, the one that leaves now not counted; kept when it is latched.
        waited, after = Signal(range(bound + 2)), Signal(range(bound + 2))
        m.d.comb += after.eq(waited + (leaves & (waited != bound)))
        m.d.sync += waited.eq(after & (requests & ~takes).replicate(len(after)))
        kept = self.count_to(m, bound, takes, leaves, start=after)
        late = (latched & (kept >= bound)) | (waited >= bound)
        yield "no_starvation", ~late, mine & (kept == bound - 1)

        if self.config.has_polarity:
            polarity = Signal()
            with m.If(takes):
                m.d.sync += polarity.eq(pick(self.polarity, self.watch))
            yield "polarity_kept", implies(named & latched, self.event_polarity == polarity), named
