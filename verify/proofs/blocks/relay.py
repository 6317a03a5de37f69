"""Check the relay station: every event passes once and in order, one per clock, with no combinational path."""

from __future__ import annotations

from typing import Any

from amaranth.hdl import Cat, Const, Module, Signal

from eskin.model.tiles.config import TilesConfig
from eskin.rtl.tiles.relay import Relay
from eskin.verify.proofs.checker import Checker, Property, before, implies

DEPTH = 2
"""Events that a station holds at most."""


class RelayChecker(Checker[TilesConfig]):
    """Checker of a relay station; both sides are free and need not follow any rules."""

    block = Relay
    properties = (
        Property("takes_what_fits", "ready is high exactly while fewer than two events are held"),
        Property("none_lost", "an event is offered exactly while one or two events are held"),
        Property(
            "in_order",
            "events leave once, unchanged, in the order in which they were taken",
            applies=lambda config: config.tile.event_bits > 0,
        ),
        Property("payload_stable", "an event that is not taken stays offered unchanged"),
        Property("no_bubble", "one clock after an event is taken, an event is offered"),
        Property("full_rate", "one clock after the output end takes events, the station takes an event"),
        Property(
            "latency", "an event that is taken while the station is or becomes empty is offered in the next clock"
        ),
    )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        comes, leaves = self.tile_valid & self.tile_ready, self.event_valid & self.event_ready
        offered, new = self._payload("event"), self._payload("tile")

        # What is held, the oldest first, from what passed by on both sides.
        held = Signal(range(DEPTH + 2))
        m.d.sync += held.eq(held + comes - leaves)
        oldest, newest = (Signal(max(1, len(new)), name=name) for name in ("oldest", "newest"))
        with m.If(comes):
            m.d.sync += newest.eq(new)
        with m.If(leaves):
            m.d.sync += oldest.eq(newest)
        with m.If(comes & (held == leaves)):
            m.d.sync += oldest.eq(new)

        self.promise(m, "takes_what_fits", self.tile_ready == (held < DEPTH), self.tile_valid & ~self.tile_ready)
        counts = (self.event_valid == (held != 0)) & (held <= DEPTH)
        self.promise(m, "none_lost", counts, held == DEPTH)
        same = offered == oldest[: len(offered)] if len(offered) else Const(1)
        self.promise(m, "in_order", implies(leaves, (held != 0) & same), leaves & (held == DEPTH))
        stalls = before(m, self.event_valid & ~self.event_ready, "stalls")
        stands = offered == before(m, offered, "offered") if len(offered) else Const(1)
        self.promise(m, "payload_stable", implies(stalls, self.event_valid & stands), stalls & (held == DEPTH))
        came = before(m, comes, "came")
        self.promise(m, "no_bubble", implies(came, self.event_valid), came & before(m, leaves, "left"))
        took = before(m, self.event_ready, "took")
        self.promise(m, "full_rate", implies(took, self.tile_ready), took & before(m, held == DEPTH, "was_full"))
        alone = before(m, comes & (held == leaves), "alone")
        first = offered == before(m, new, "new") if len(offered) else Const(1)
        self.promise(m, "latency", implies(alone, self.event_valid & first), alone & came & leaves)
        return self.finish(m)

    def _payload(self, stream: str) -> Any:
        """Return the payload of a side."""
        names = [f"{stream}_{name}" for name in ("col", "row", "polarity")]
        return Cat(getattr(self, name) for name in names if self.has(name))
