"""Cycle-accurate simulation of a skin: all tiles, and the merge of their events.

A tile's clock is that of ``eskin.model.readout``, whose loop for a single readout is kept apart for its speed.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from eskin.base.errors import InputError
from eskin.base.files import forget_stale_kernels
from eskin.model import arbiter, decay, readout
from eskin.model.address_events import Events, make_events
from eskin.model.arbiter import ONE, ZERO
from eskin.model.links.link import Sink
from eskin.model.readout import (
    Inputs,
    Registers,
    Stimulus,
    ask,
    ask_fresh,
    decide,
    mask_rows,
    take_samples,
    with_room,
)
from eskin.model.taxel_kernels import Parameters
from eskin.model.tiles import merge, relay
from eskin.model.tiles.config import TilesConfig

forget_stale_kernels(Path(__file__), (*readout.SOURCES, *(Path(str(m.__file__)) for m in (readout, merge, relay))))

# Words of a tile's place in its inputs: number of sample ticks and of masks so far, whether the previous clock was a
# sample tick, and whether a threshold moved in it.
TICKS, CHANGES, TICK, AGAIN = range(4)


def simulate_skin(config: TilesConfig, stimuli: Sequence[Stimulus]) -> Events:
    """Return the address events of a skin, equal to those of the RTL.

    The stimuli of the tiles have common clocks of samples, masks and end; the first gives the sink's ready. t is the
    clock of the transfer from the merge; x and y are coordinates on the skin.
    """
    tile, first = config.tile, stimuli[0]
    if len(stimuli) != config.tiles:
        raise InputError(f"{config.tiles} tiles need {config.tiles} stimuli, not {len(stimuli)}")
    for stimulus in stimuli:
        stimulus.check(tile)
        same = (
            np.array_equal(getattr(stimulus, name), getattr(first, name)) for name in ("sample_clock", "enable_clock")
        )
        if not all(same) or stimulus.clocks != first.clocks or stimulus.decisions is not None:
            raise InputError(
                "the tiles' stimuli must share the clocks of samples, masks and end, and have no decisions"
            )
    registers = [Registers.after_reset(tile) for _ in stimuli]
    inputs = Inputs(
        np.stack([np.ascontiguousarray(stimulus.samples, np.int32) for stimulus in stimuli]),
        first.sample_clock,
        first.clocks,
        first.enable_clock,
        np.stack([stimulus.enable for stimulus in stimuli]),
        Sink(first.ready, first.ack_delay),
        decay.decay_phases(tile),
        np.zeros((0, 0), np.uint8),
        np.zeros(0, np.int64),
        np.zeros((0, 0), np.int32),
        np.zeros(0, np.int64),
    )
    all_of = Registers(*(np.stack(column) for column in zip(*registers, strict=True)))
    time, event = _loop(Parameters.of(tile), inputs, all_of, tile.taxels, config.relays).T
    number, address = np.divmod(event >> 1, tile.taxels)
    return config.on_skin(number, make_events(time, *np.divmod(address, tile.columns), event & 1))


def scan_skin(config: TilesConfig, scan: Any, image: ArrayLike) -> list[Stimulus]:
    """Return the stimulus of every tile for a skin that slides over an image."""
    samples, _ = scan.samples(config, image)
    return [Stimulus.from_samples(config.tile, samples[:, config.taxels_of(i)]) for i in range(config.tiles)]


@njit(cache=True, nogil=True)
def _loop(p: Parameters, s: Inputs, r: Registers, taxels: int, relays: int) -> NDArray[np.int64]:
    """Return the clock and address of every event, shape (events, 2)."""
    tiles = len(s.samples)
    at = np.zeros((tiles, 4), np.int64)
    state = np.zeros(4, np.uint64)
    lines = np.zeros((tiles, relays, 4), np.uint64)
    log = np.empty((1024, 2), np.int64)
    events = 0
    t = 0
    while t < s.clocks:
        ready = s.sink.ready[t % len(s.sink.ready)] != 0
        if ready and state[merge.HELD] != ZERO:
            log = with_room(log, events)
            log[events, 0], log[events, 1] = t, np.int64(state[merge.OFFERED])
            events += 1
        asking = ZERO
        for i in range(tiles):
            if relay.offers(lines[i]) if relays else arbiter.offers(r.latch[i]):
                asking |= ONE << np.uint64(i)
        chosen = merge.chosen(state, asking)
        event = np.int64(0)
        if chosen >= 0:
            event = np.int64(lines[chosen, -1, merge.OFFERED]) if relays else _take(p, r, chosen, taxels)
        merge.advance(state, chosen, event, ready)

        rests = state[merge.HELD] == ZERO
        for i in range(tiles if relays else 0):
            comes = arbiter.offers(r.latch[i]) and relay.room(lines[i])
            relay.advance(lines[i], comes, _take(p, r, i, taxels) if comes else np.int64(0), i == chosen)
            rests &= not lines[i, :, merge.HELD].any()
        for i in range(tiles):
            _clock(p, s, t, i, r.taxels[i], r.rows[i], r.latch[i], at[i])
            rests &= arbiter.idle(r.latch[i]) and at[i, TICK] == 0 and at[i, AGAIN] == 0
        t += 1
        if rests:
            until = s.sample_clock[at[0, TICKS]] if at[0, TICKS] < len(s.sample_clock) else s.clocks
            if at[0, CHANGES] < len(s.enable_clock):
                until = min(until, s.enable_clock[at[0, CHANGES]])
            t = max(t, min(until, s.clocks))
    return log[:events]


@njit(cache=True)
def _take(p: Any, r: Any, tile: int, taxels: int) -> np.int64:
    """Remove the offered event from a tile and return its address: 2 * (tile * taxels + taxel) + polarity."""
    return np.int64(2 * tile * taxels + arbiter.take(r.latch[tile], p.columns))


@njit(cache=True, nogil=True)
def _clock(p: Any, s: Any, t: int, tile: int, taxels: Any, rows: Any, latch: Any, at: NDArray[np.int64]) -> None:
    """Advance a tile by one clock; see ``eskin.model.readout._loop``."""
    masked = at[CHANGES] < len(s.enable_clock) and s.enable_clock[at[CHANGES]] == t
    if masked:
        mask_rows(p, s.enable[tile, at[CHANGES]], taxels, rows, latch)
        at[CHANGES] += 1
    row = arbiter.grant(latch, rows)
    tick = at[TICK] != 0
    everyone = tick or (p.digital and (masked or t == 0))
    if everyone or at[AGAIN] != 0 or row >= 0:
        first, last = (0, len(rows)) if everyone or at[AGAIN] != 0 else (row, row + 1)
        again = False
        for y in range(first, last):
            leaks = tick and p.leaks and decay.is_due(p.rule.leak_period, s.phases[y], at[TICKS] - 1)
            todo = rows[y].again | (latch[arbiter.TAKEN] if y == row else ZERO)
            again |= decide(p, y, ~ZERO if everyone else todo, tick, leaks, taxels, rows, latch)
        at[AGAIN] = again
    if masked and ask_fresh(p, rows):
        at[AGAIN] = 1
    at[TICK] = at[TICKS] < len(s.sample_clock) and s.sample_clock[at[TICKS]] == t
    if at[TICK]:
        take_samples(p, s.samples[tile, at[TICKS]], taxels, rows)
        ask(p, rows)
        at[TICKS] += 1
