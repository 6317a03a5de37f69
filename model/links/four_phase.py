"""The four-phase AER link: REQ/ACK handshake with bundled address, and an asynchronous receiver."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from eskin.model.links.link import ACK_QUANTA, NOTHING, Bits, Link, Read, Shown, Sink, Timing, parts, shifted

if TYPE_CHECKING:
    from eskin.model.config import ReadoutConfig

# Words of the link's state: its four flops, the level of ACK, the clock at which ACK changes (-1: settled), the number
# of edges of REQ so far, and the event on the wires.
SETUP, REQ, ACK_META, ACK_SYNC, ACK, ACK_AT, EDGES, EVENT = range(8)


class FourPhaseTiming(Timing):
    """Constants of the four-phase link."""


class FourPhase(Link):
    """One request wire; the address has the polarity."""

    name = "four_phase"
    title = "four-phase"
    leaves = "the edge that raises `aer_req`"
    at_best = "ACK follows REQ within a clock"
    clocks_per_event = 7
    holds = 1
    address = ("aer_addr",)
    requests: ClassVar[tuple[str, ...]] = ("aer_req",)
    Rule: ClassVar = FourPhaseTiming

    def shown(self, config: ReadoutConfig, read: Read, bits: Bits = shifted) -> Shown:
        address, row_at = read("aer_addr"), config.column_bits
        requests = tuple(read(name) for name in self.requests)
        polarity: Any = 1
        if self.request_has_polarity:
            polarity = requests[0]
        elif config.has_polarity:
            polarity = bits(address, row_at + config.row_bits, 1)
        return Shown(requests, bits(address, row_at, config.row_bits), bits(address, 0, row_at), polarity)

    def levels(self, config: ReadoutConfig, state: Any, sink: Sink, clock: int, offered: int) -> dict[str, int | None]:
        row, column, polarity = parts(config, int(state[EVENT]))
        word = polarity << config.row_bits + config.column_bits | row << config.column_bits | column
        found: dict[str, int | None] = (
            {"aer_addr": word & (1 << config.address_bits) - 1} if config.address_bits else {}
        )
        for level, name in [*enumerate(reversed(self.requests))]:
            named = polarity == level or not self.request_has_polarity
            found[name] = int(state[REQ] and named)
        ack = state[REQ] if state[ACK_AT] == clock else state[ACK]
        return found | {"aer_ack": int(ack)}

    def rule(self) -> FourPhaseTiming:
        return FourPhaseTiming(late=1)

    def new_state(self) -> NDArray[np.int64]:
        state = np.zeros(8, np.int64)
        state[ACK_AT] = -1
        state[ACK_META] = state[ACK_SYNC] = 1  # ACK counts as high until it has been seen low
        return state

    @staticmethod
    def ready(rule: Any, state: Any, sink: Any, clock: int) -> bool:
        return state[SETUP] == 0 and state[REQ] == 0 and state[ACK_SYNC] == 0

    @staticmethod
    def advance(rule: Any, state: Any, sink: Any, clock: int, taken: int) -> int:
        """Advance the link by a clock edge; the event leaves at the edge that raises REQ."""
        if state[ACK_AT] == clock:
            state[ACK] = state[REQ]
            state[ACK_AT] = -1
        before = state[REQ]
        if state[SETUP] == 1:
            state[REQ] = 1
        elif state[ACK_SYNC] == 1:
            state[REQ] = 0
        state[SETUP] = 0
        if taken != NOTHING:
            state[SETUP], state[EVENT] = 1, taken
        state[ACK_SYNC] = state[ACK_META]
        state[ACK_META] = state[ACK]
        if state[REQ] != before:
            delay = sink.ack_delay[state[EDGES] % len(sink.ack_delay)]
            state[ACK_AT] = clock + (delay + ACK_QUANTA - 1) // ACK_QUANTA
            state[EDGES] += 1
        return state[EVENT] if state[REQ] > before else NOTHING

    @staticmethod
    def rests(rule: Any, state: Any) -> bool:
        return state[SETUP] == 0 and state[REQ] == 0 and state[ACK_SYNC] == 0
