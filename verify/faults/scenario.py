"""Stimuli for fault injection: low load, or overload with masks and a stuck sink."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eskin.model.address_events import EVENT_DTYPE, Events
from eskin.model.config import ReadoutConfig
from eskin.model.links.link import ACK_QUANTA
from eskin.model.readout import Stimulus

RESET = 2
"""Clocks of reset at the beginning of every run."""
CALM_TICKS, LOADED_TICKS = 10, 24
"""Sample ticks with bit flips, at low load and in overload."""
SWING = 5
"""Steps from rest to the end of the swing at the end of every run, which all taxels must answer normally."""


@dataclass(frozen=True)
class Course:
    """A stimulus, with the clocks in which flops are flipped and responses are compared."""

    stimulus: Stimulus  # for the model
    inputs: dict[str, NDArray[np.uint8]]  # for the gates, shape (clocks, bits); ``RESET`` clocks more
    last: int  # end of the clocks in which upsets happen, counted from the first clock of reset
    answer: int  # clock from which on every difference is lasting
    ticks: NDArray[np.int64]  # the beginning of the run, and the sample ticks before ``last``, shape (ticks + 1,)


def course(config: ReadoutConfig, calm: bool, slow: int = 0) -> Course:
    """Return a stimulus for a configuration.

    In a calm course few taxels move with a tick, and all is silent before the next; else there is overload, the mask
    changes and the sink stands still. ``slow`` is the number of clocks that a receiver takes for each edge of ACK.
    """
    rng = np.random.default_rng(0)
    per_event = config.protocol.clocks_per_event + 2 * slow * config.protocol.asynchronous
    gap, ticks = (16 * per_event + 8, CALM_TICKS) if calm else (16, LOADED_TICKS)
    moves = np.zeros((ticks, config.taxels), np.int64)
    for move in moves:
        if calm:  # up to three taxels move by up to two steps
            move[rng.integers(config.taxels, size=3)] = config.step * rng.integers(-2, 3, size=3)
        else:
            move[:] = rng.integers(-config.full_scale, config.full_scale, config.taxels)
    levels = list(np.clip(np.cumsum(moves, axis=0) if calm else moves, -config.full_scale, config.full_scale - 1))
    clocks = (3 + gap * np.arange(ticks)).tolist()
    end = gap * ticks
    # All go up and down: thrice to become alike again, and once more to be compared.
    pause = pause_of(config, per_event)
    for clock, level in swings(config, end, 4, pause):
        clocks.append(clock)
        levels.append(level)
    total = end + 4 * pause
    masks = np.ones((3, config.taxels), bool)
    masks[1] = calm | (rng.random(config.taxels) < 0.5)
    ready = np.ones(total, np.uint8)
    if not calm:
        ready[end // 4 : end // 2] = rng.random(end // 2 - end // 4) < 0.6
        ready[5 * end // 8 : 3 * end // 4] = 0
    stimulus = Stimulus(
        samples=np.array(levels, np.int32),
        sample_clock=np.array(clocks, np.int64),
        clocks=total,
        enable_clock=np.array([0, end // 2, 5 * end // 8], np.int64),
        enable=masks,
        ready=ready,
        ack_delay=np.array([ACK_QUANTA * slow + 1], np.int64),
    )
    ticks_at = np.array([0, *(RESET + clock for clock in clocks if clock < end)])
    return Course(stimulus, inputs_of(config, stimulus), RESET + end, RESET + end + 3 * pause, ticks_at)


def pause_of(config: ReadoutConfig, per_event: int = 1) -> int:
    """Return the clocks in which all taxels can move from one end of the scale to the other."""
    return (2 * config.full_scale // config.step + 2) * config.taxels * per_event + 40


def swings(config: ReadoutConfig, start: int, number: int, pause: int) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """Yield clock and levels of sample ticks that swing all taxels up and down in turn.

    Behind each swing they rest so that windows close.
    """
    quiet = 12 * config.leak_period if config.encoder.leaks else 0
    if config.closes:
        quiet = config.window_period << config.closing_levels_log2
    for swing in range(number):
        level = np.full(config.taxels, SWING * config.step * (1 - 2 * ((number - 1 - swing) % 2)))
        for tick in range(quiet + 1):
            yield start + swing * pause + tick * ((pause - 8) // (quiet + 1)), level


def inputs_of(config: ReadoutConfig, stimulus: Stimulus) -> dict[str, NDArray[np.uint8]]:
    """Return a stimulus as input bits of the readout in every clock, after ``RESET`` clocks of reset."""
    clocks = stimulus.clocks
    tick = np.searchsorted(stimulus.sample_clock, np.arange(clocks), side="right") - 1
    codes = np.where(tick[:, None] >= 0, stimulus.samples[np.maximum(tick, 0)], 0)
    mask = np.searchsorted(stimulus.enable_clock, np.arange(clocks), side="right") - 1
    bits = {
        "sample": (codes[:, :, None] >> np.arange(config.sample_bits) & 1).reshape(clocks, -1),
        "sample_valid": np.isin(np.arange(clocks), stimulus.sample_clock)[:, None],
        "taxel_enable": stimulus.enable[mask],
        "event_ready": np.resize(stimulus.ready, clocks)[:, None],
        **{name: np.zeros((clocks, 1)) for name in ("ack_high", "ack_turned", "rst")},
    }
    before = {name: np.zeros((RESET, values.shape[1])) for name, values in bits.items()} | {"rst": np.ones((RESET, 1))}
    return {name: np.concatenate([before[name], values]).astype(np.uint8) for name, values in bits.items()}


def codes_of(
    config: ReadoutConfig, outputs: dict[str, NDArray[np.int64]], ready: NDArray[np.uint8]
) -> NDArray[np.int16]:
    """Return the events of runs, shape (clocks, runs): 2 * taxel + polarity, or -1 in clocks without an event.

    An event of a late link is in the clock before that in which it is first seen, as in the model.
    """
    levels = outputs | {"event_ready": ready.astype(np.int64)}
    nothing = np.zeros(next(iter(outputs.values())).shape, np.int64)
    shown = config.protocol.shown(config, lambda name: levels.get(name, nothing))
    event = 2 * (shown.row * config.columns + shown.column) + shown.polarity
    there = np.any(shown.high, axis=0)
    if config.protocol.rule().late:
        there[:-1] = there[1:] > there[:-1]
        there[-1] = False
        event[:-1] = event[1:]
    return np.where(there, event, -1).astype(np.int16)


def events_of(config: ReadoutConfig, codes: NDArray[np.int16]) -> Events:
    """Return the events of one run after its reset, in the form of the model's events."""
    at = np.flatnonzero(codes >= 0)
    events = np.empty(len(at), EVENT_DTYPE)
    events["t"], events["p"] = at - RESET, codes[at] & 1
    events["y"], events["x"] = np.divmod(codes[at] >> 1, config.columns)
    return events
