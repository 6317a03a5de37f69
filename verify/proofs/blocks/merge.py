"""Properties of merge and relay stations: choice of the tile, transferred events, longest wait."""

from typing import Any, ClassVar

from amaranth.hdl import Cat, Const, Module, Mux, Signal

from eskin.model.tiles.config import TilesConfig
from eskin.rtl.tiles.merge import Merge
from eskin.rtl.tiles.relay import Relay
from eskin.verify.proofs.checker import Checker, Promises, at_most_one, before, cyclic, implies, pick, within

DEPTH = 2
"""Largest number of events that a merge or a relay station holds."""


class MergeChecker(Checker[TilesConfig]):
    """Checker of the merge; the event streams of the tiles are free.

    ``watch`` and ``rival`` are any two tiles, for good.
    """

    block = Merge
    only: ClassVar = {"fairness": lambda config: config.tiles > 1}
    assumptions: ClassVar = {
        "tiles_hold_events": "an event that a tile offers stays, the same in every bit, until taken"
    }

    def constants(self, config: TilesConfig) -> dict[str, int]:
        return dict.fromkeys(("watch", "rival"), config.tiles)

    def check(self, m: Module) -> Promises:
        tiles = self.config.tiles
        taken = self.tile_valid & self.tile_ready
        comes, leaves = taken.any(), self.event_valid & self.event_ready

        # The tiles' side: what is offered stays.
        offers = [self._payload("tile", index) for index in range(tiles)]
        stays = Const(1)
        for index, payload in enumerate(offers):
            stays &= self.unchanged(m, self.tile_valid[index], self.tile_ready[index], payload)[0]
        kept = Signal(init=1)
        m.d.sync += kept.eq(kept & stays)
        self.suppose(m, "tiles_hold_events", stays)

        held = Signal(range(DEPTH + 2))
        m.d.sync += held.eq(held + comes - leaves)
        yield "takes_one", at_most_one(self.tile_ready) & within(self.tile_ready, self.tile_valid), comes
        fits = held < DEPTH
        yield "takes_what_fits", comes == (self.tile_valid.any() & fits), self.tile_valid.any() & ~fits
        counts = (self.event_valid == (held != 0)) & (held <= DEPTH)
        yield "none_lost", counts, held == DEPTH
        asked, left = before(m, self.tile_valid.any(), "asked"), before(m, self.tile_valid.any() & leaves, "left")
        yield "no_bubble", implies(asked, self.event_valid), left & self.event_valid
        offered = self._payload("event", 0, with_tile=True)
        yield "payload_stable", *self.unchanged(m, self.event_valid, self.event_ready, offered)
        last, jumps = cyclic(m, self.tile_valid, taken)
        yield "tile_order", ~jumps, taken.any() & (taken <= last)
        yield from self._watched(m, taken, leaves, kept & stays, offers)

    def _watched(self, m: Module, taken: Any, leaves: Any, kept: Any, offers: list[Any]) -> Promises:
        """Track the events of one tile: those in the merge, and the offered event."""
        tiles = self.config.tiles
        given = pick(taken, self.watch)
        mine = leaves & (self.port("event_tile") == self.watch)
        inside = Signal(range(DEPTH + 2))
        m.d.sync += inside.eq(inside + given - mine)
        payload = pick(offers, self.watch) if len(offers[0]) else None
        right: Any = inside != 0
        if payload is not None:
            oldest, newest = (Signal(len(offers[0]), name=name) for name in ("oldest", "newest"))
            with m.If(given):
                m.d.sync += newest.eq(payload)
            with m.If(mine | (inside == 0)):
                m.d.sync += oldest.eq(Mux(inside == DEPTH, newest, payload))
            right &= self._payload("event", 0) == oldest
        exists = self.port("event_tile") < tiles
        yield "in_order", implies(mine, right) & implies(self.event_valid, exists), mine & (inside == DEPTH)

        # Events that left since the watched tile's was offered, the one that leaves now not counted.
        bound = tiles + DEPTH
        waits = pick(self.tile_valid & ~self.tile_ready, self.watch)
        waited, after = Signal(range(bound + 1)), Signal(range(bound + 1))
        m.d.comb += after.eq(waited + (leaves & (waited != bound)))
        m.d.sync += waited.eq(Mux(waits, after, 0))
        # The newest event of the tile within the merge is the latest to leave.
        kept_count = self.count_to(m, bound, given, leaves, start=after)
        late = ((inside != 0) & (kept_count >= bound)) | (waited >= bound)
        yield "no_starvation", implies(kept, ~late), mine & (inside == 1) & (kept_count == bound - 1)

        if tiles > 1:
            other = pick(taken, self.rival)
            yield "fairness", *self.fair(m, given, pick(self.tile_valid, self.rival), other)

    def _payload(self, stream: str, index: int, with_tile: bool = False) -> Any:
        """Return the payload of a tile's stream or of the merged stream."""
        words = [getattr(self, f"{stream}_{name}") for name in ("col", "row", "polarity") if self.has(f"event_{name}")]
        parts = self.config.tiles if stream == "tile" else 1
        bits = [len(word) // parts for word in words]
        fields = [word[index * width : (index + 1) * width] for word, width in zip(words, bits, strict=True)]
        return Cat(*fields, *([self.port("event_tile")] if with_tile else []))


class RelayChecker(Checker[TilesConfig]):
    """Checker of a relay station; both sides are free."""

    block = Relay
    only: ClassVar = {"in_order": lambda config: config.tile.event_bits > 0}

    def check(self, m: Module) -> Promises:
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

        yield "takes_what_fits", self.tile_ready == (held < DEPTH), self.tile_valid & ~self.tile_ready
        counts = (self.event_valid == (held != 0)) & (held <= DEPTH)
        yield "none_lost", counts, held == DEPTH
        same = offered == oldest[: len(offered)] if len(offered) else Const(1)
        yield "in_order", implies(leaves, (held != 0) & same), leaves & (held == DEPTH)
        stands, stalls = self.unchanged(m, self.event_valid, self.event_ready, offered)
        yield "payload_stable", stands, stalls & (held == DEPTH)
        came = before(m, comes, "came")
        yield "no_bubble", implies(came, self.event_valid), came & before(m, leaves, "left")
        took = before(m, self.event_ready, "took")
        yield "full_rate", implies(took, self.tile_ready), took & before(m, held == DEPTH, "was_full")
        alone = before(m, comes & (held == leaves), "alone")
        first = offered == before(m, new, "new") if len(offered) else Const(1)
        yield "latency", implies(alone, self.event_valid & first), alone & came & leaves

    def _payload(self, stream: str) -> Any:
        """Return the payload of one side."""
        names = [f"{stream}_{name}" for name in ("col", "row", "polarity")]
        return Cat(getattr(self, name) for name in names if self.has(name))
