"""Measure the latencies of a readout in clocks by simulating its golden model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eskin.flow.datasheet.waves import TICK, from_zero, played
from eskin.model.address_events import Events
from eskin.model.config import ReadoutConfig
from eskin.model.readout import Stimulus, simulate

AHEAD_OF_A_GRANT, HELD_BY_LINK = 2, 1
"""Clocks to be latched and to appear; an event in the register of the link (docs/design/microarchitecture.md)."""


@dataclass(frozen=True)
class Latencies:
    """Latencies of a readout."""

    latency: int  # clocks from the sample tick to ``event_valid``, or to the edge that raises ``aer_req``, array idle
    # clocks per event if every taxel has one, the sink takes all and ACK follows REQ at once
    clocks_per_event: int
    longest_gap: int  # clocks between two events of one taxel at most, in that simulation
    # bound_events, bound_clocks: largest number of events, and of clocks, until the event of a request has left
    bound_events: int
    bound_clocks: int

    @classmethod
    def of(cls, config: ReadoutConfig) -> Latencies:
        """Return the latencies of a configuration."""
        config = from_zero(config)
        first = played(config)
        first.ready[:] = 1
        latency = int(simulate(config, first)["t"][0]) - TICK
        events = simulate(*_saturated(config))
        # All taxels have an event from the first clock on, so at least this many events leave without a gap.
        every = int(np.diff(events["t"][: max(config.taxels, 2)]).max())
        held = HELD_BY_LINK if config.handshake else 0
        bound = (config.rows + 1) * config.columns + held
        return cls(latency, every, _longest_gap(config, events), bound, every * bound + AHEAD_OF_A_GRANT)


def _saturated(config: ReadoutConfig) -> tuple[ReadoutConfig, Stimulus]:
    """Return configuration and stimulus for a run in which every taxel requests as often as possible."""
    sample = np.full((1, config.taxels), config.full_scale - 1, np.int32)
    clocks = 20 * (config.taxels + 2)
    eager = config.replace(decide_every="clock")
    return eager, Stimulus.from_samples(eager, sample, clocks=clocks)


def _longest_gap(config: ReadoutConfig, events: Events) -> int:
    """Return the largest number of clocks between two events of one taxel."""
    taxel = events["y"].astype(int) * config.columns + events["x"]
    order = np.argsort(taxel, kind="stable")
    gaps = np.diff(events["t"][order])[np.diff(taxel[order]) == 0]
    return int(gaps.max())
