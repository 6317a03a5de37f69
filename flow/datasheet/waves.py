"""Compute waveforms and latencies of a readout with its golden model."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eskin.flow.datasheet.sheet import Wave
from eskin.model.address_events import Events
from eskin.model.config import ReadoutConfig
from eskin.model.links.link import ACK_QUANTA, NOTHING, Sink
from eskin.model.readout import TAKEN, WAITED, Stimulus, simulate, simulate_counted, state_at, strobes
from eskin.rtl.links import registry as links

TICK = 2
"""Clock of the sample tick."""

TAXELS = 3
"""Largest number of taxels that send one event each."""

STALL = range(TICK + 3, TICK + 5)
"""Clocks in which the sink of a stream takes nothing."""

ACK_DELAY = 4
"""Delay of ACK after each edge of REQ, in 1/8 clock."""

RESET_CLOCKS, CLOCKS_AFTER = 3, 9

CLOCKS_BESIDE = 8
"""Clocks before the first event at the arbiter, and behind the last event."""

AHEAD_OF_A_GRANT = 2
"""Clocks to be latched and to appear (docs/design/microarchitecture.md)."""


def from_zero(config: ReadoutConfig) -> ReadoutConfig:
    """Return the configuration with references of 0 after reset and without receptive fields.

    There is room for a step up, and a sample crosses the level of its own taxel. The adders of fields have no register,
    so the times are the same.
    """
    return config.replace(reference_reset=0, receptive_fields="own")


def played(config: ReadoutConfig) -> Stimulus:
    """Return a stimulus with one sample that makes the first taxels cross a level."""
    samples = np.zeros((1, config.taxels), np.int32)
    samples[0, :TAXELS] = config.step + config.encoder.strict
    link = config.protocol
    stalled = 0 if link.asynchronous else len(STALL)
    clocks = CLOCKS_BESIDE + link.holds + stalled + (TAXELS - 1) * link.clocks_per_event
    ready = np.array([clock not in STALL for clock in range(clocks)], np.uint8)
    return Stimulus(
        samples=samples,
        sample_clock=np.full(1, TICK, np.int64),
        clocks=clocks,
        enable_clock=np.zeros(1, np.int64),
        enable=np.ones((1, config.taxels), bool),
        ready=ready,
        ack_delay=np.full(1, ACK_DELAY, np.int64),
    )


class Latencies(NamedTuple):
    """Latencies of a readout in clocks."""

    latency: int  # from the sample tick to ``event_valid``, or to the edge that raises ``aer_req``, array idle
    clocks_per_event: int  # if every taxel has an event, the sink takes all and ACK follows REQ at once
    longest_gap: int  # between two events of one taxel at most, in that simulation
    # bound_events, bound_clocks: largest number of events, and of clocks, until the event of a request has left
    bound_events: int
    bound_clocks: int


def latencies(config: ReadoutConfig) -> Latencies:
    """Return the latencies of a readout."""
    config = from_zero(config)
    first = played(config)
    first.ready[:] = 1
    latency = int(simulate(config, first)["t"][0]) - TICK
    eager = config.replace(decide_every="clock")  # every taxel requests as often as possible
    sample = np.full((1, config.taxels), config.full_scale - 1, np.int32)
    events = simulate(eager, Stimulus.from_samples(eager, sample, clocks=20 * (config.taxels + 2)))
    # All taxels have an event from the first clock on, so at least this many events leave without a gap.
    every = int(np.diff(events["t"][: max(config.taxels, 2)]).max())
    taxel = events["y"].astype(int) * config.columns + events["x"]
    order = np.argsort(taxel, kind="stable")
    longest = int(np.diff(events["t"][order])[np.diff(taxel[order]) == 0].max())
    bound = (config.rows + 1) * config.columns + config.protocol.holds
    return Latencies(latency, every, longest, bound, every * bound + AHEAD_OF_A_GRANT)


def waves(config: ReadoutConfig) -> list[Wave]:
    """Return the waveforms on the path from a sample to its events."""
    config = from_zero(config)
    stimulus = played(config)
    events, traffic = simulate_counted(config, stimulus)
    states = [state_at(config, stimulus, clock) for clock in range(stimulus.clocks)]
    tick = tuple(int(clock == TICK) for clock in range(stimulus.clocks))
    found = [Wave("sample_valid", tick)]
    if config.frontend == "digital":
        # The taxel takes it with the edge that ends the clock of the tick.
        code = int(stimulus.samples[0, 0])
        found.append(Wave("sample, taxel 0", tuple(code if one else None for one in tick), bus=True))
    # References as sample codes, rounded down.
    codes = [int(state.reference[0, 0] >> config.encoder.fraction_bits(config)) for state in states]
    widths = [int(state.half_width[0, 0]) for state in states]
    if config.frontend == "analog":
        levels = [code + width + config.encoder.strict for code, width in zip(codes, widths, strict=True)]
        above = tuple(int(state.sample[0, 0] >= level) for state, level in zip(states, levels, strict=True))
        asked = tuple(int(on) for on in strobes(config, stimulus)[:, 0])
        found += [Wave("compare, taxel 0", asked), Wave("above, taxel 0", above)]
    found.append(Wave("reference, taxel 0", tuple(codes), bus=True))
    if config.closes:
        found.append(Wave("half width, taxel 0", tuple(widths), bus=True))
    found.append(Wave("request, row 0", tuple(int(state.pending[0].any()) for state in states)))
    return found + _link(config, stimulus, events, traffic)


def reset_waves(config: ReadoutConfig) -> list[Wave]:
    """Return the waveforms around a reset during the transfer of an event."""
    found = waves(config)
    cut = STALL[1]
    if requests := config.protocol.requests:  # the address is stable and REQ is low: the reset interrupts no handshake
        cut = min(w.values.index(1) for w in found if w.name in requests and 1 in w.values) - 1
    first = int(config.reset == "sync")  # its first clock still shows what was: it works with the edge that ends it
    reset = (0,) * cut + (1,) * RESET_CLOCKS + (0,) * CLOCKS_AFTER
    mended = []
    for wave in found:
        within = wave.values[cut : cut + first] + wave.values[:1] * (RESET_CLOCKS - first)
        mended.append(Wave(wave.name, wave.values[:cut] + within + wave.values[:CLOCKS_AFTER], wave.bus, wave.delay))
    return [Wave("rst", reset), *mended]


def address(config: ReadoutConfig, event: np.void) -> int:
    """Return the address word of an event: polarity, row, column."""
    word = int(event["y"]) << config.column_bits | int(event["x"])
    return word | int(event["p"]) << (config.row_bits + config.column_bits) if config.has_polarity else word


def _link(config: ReadoutConfig, stimulus: Stimulus, events: Events, traffic: NDArray[np.uint8]) -> list[Wave]:
    """Return the waveforms of the ports of the link."""
    link, sink = config.protocol, Sink(stimulus.ready, stimulus.ack_delay)
    numbers = [int(2 * (event["y"] * config.columns + event["x"]) + event["p"]) for event in events]
    state, levels = link.new_state(), []
    for clock in range(stimulus.clocks):
        offered = numbers[0] if traffic[clock] in (TAKEN, WAITED) and numbers else NOTHING
        levels.append(link.levels(config, state, sink, clock, offered))
        taken = numbers.pop(0) if traffic[clock] == TAKEN and numbers else NOTHING
        link.advance(link.rule(), state, sink, clock, taken)
    late = dict.fromkeys(links.named(config.link).asynchronous, ACK_DELAY / ACK_QUANTA)
    return [
        Wave(name, tuple(level[name] for level in levels), name in link.address, late.get(name, 0))
        for name in levels[0]
    ]
