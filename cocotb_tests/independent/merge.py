"""Merge of tiles: round robin over the offering tiles."""

from collections.abc import Sequence

from eskin.cocotb_tests.independent.arbiter import Event


class Merge:
    """Merge with a two-event queue.

    Attributes
    ----------
    queue : list of (tile, event) that have not left, the oldest first
    last : the tile that was taken last; after a reset the last of all, so that tile 0 comes first
    """

    def __init__(self, tiles: int) -> None:
        self.tiles = tiles
        self.reset()

    def reset(self) -> None:
        """Reset the merge."""
        self.queue: list[tuple[int, Event]] = []
        self.last = self.tiles - 1

    def output(self) -> tuple[int, Event] | None:
        """Return the offered (tile, event) in this clock, or None."""
        return self.queue[0] if self.queue else None

    def taken(self, offered: Sequence[Event | None]) -> int | None:
        """Return the tile whose event is taken in this clock, or None; `offered` has an event or None for each tile."""
        if len(self.queue) == 2:
            return None
        for distance in range(1, self.tiles + 1):
            tile = (self.last + distance) % self.tiles
            if offered[tile] is not None:
                return tile
        return None

    def clock(self, offered: Sequence[Event | None], ready: bool) -> None:
        """Apply a rising edge; `ready` comes from the sink."""
        tile = self.taken(offered)
        if self.queue and ready:
            self.queue.pop(0)
        if tile is not None and (event := offered[tile]) is not None:
            self.queue.append((tile, event))
            self.last = tile
