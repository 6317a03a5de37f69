"""The array, its arbiter and its link, clock by clock: the golden model that the RTL is held to.

The loop visits only the clocks in which something can change, which is exact: a taxel that decided for nothing
decides so again until its sample, its reference or its window moves.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from model import link
from model.arbiter import ONE, ZERO, lowest, next_row, rows_behind, without_lowest
from model.config import ReadoutConfig
from model.decay import decay_phases
from model.errors import InputError
from model.events.address import EVENT_DTYPE, Events

LCS, CW_LCS, N_LCS = range(3)
_ENCODING = {"lcs": LCS, "cw-lcs": CW_LCS, "nlcs": N_LCS}


@dataclass(frozen=True)
class Stimulus:
    """What happens at the inputs of a readout from the end of reset on.

    Attributes
    ----------
    samples : ndarray of int32, shape (ticks, taxels)
        Codes of all taxels at every sample tick.
    sample_clock : ndarray of int64, shape (ticks,)
        Clock of every sample tick, rising.
    clocks : int
        Length of the run; what happens at this clock or later is not seen (a REQ that rises at an edge is seen
        in the clock after it).
    enable_clock, enable : ndarray of int64, shape (changes,), and of bool, shape (changes, taxels)
        Masks and the clocks from which on they hold; the first at clock 0.
    ready : ndarray of uint8, shape (pattern,)
        ``event_ready`` per clock, repeated (stream link).
    ack_delay : ndarray of int64, shape (delays,)
        From each edge of REQ to that of ACK in 1/8 clock, repeated, never a multiple of 8 (four-phase link).
    """

    samples: NDArray[np.int32]
    sample_clock: NDArray[np.int64]
    clocks: int
    enable_clock: NDArray[np.int64]
    enable: NDArray[np.bool_]
    ready: NDArray[np.uint8] = field(default_factory=lambda: np.ones(1, np.uint8))
    ack_delay: NDArray[np.int64] = field(default_factory=lambda: np.ones(1, np.int64))

    @classmethod
    def from_samples(
        cls,
        config: ReadoutConfig,
        samples: NDArray[np.integer],
        *,
        clocks_per_sample: int | None = None,
        clocks: int | None = None,
        ready: NDArray[np.uint8] | None = None,
        ack_delay: NDArray[np.int64] | None = None,
    ) -> Stimulus:
        """Return samples at a constant rate to taxels that are all enabled.

        Parameters
        ----------
        config : ReadoutConfig
        samples : integer ndarray, shape (ticks, taxels)
        clocks_per_sample : int, optional
            By default that of the configuration.
        clocks : int, optional
            Length of the run; by default one sample period for every sample.
        ready, ack_delay : ndarray, optional
            See the attributes; by default the sink is always ready, and ACK follows in 1/8 clock.

        Raises
        ------
        InputError
            If the samples are not integers, out of range, or of another shape.
        """
        period = config.clocks_per_sample if clocks_per_sample is None else clocks_per_sample
        samples = np.asarray(samples)
        _check_samples(config, samples)
        return cls(
            samples=samples.astype(np.int32),
            sample_clock=np.arange(len(samples), dtype=np.int64) * period,
            clocks=len(samples) * period if clocks is None else clocks,
            enable_clock=np.zeros(1, np.int64),
            enable=np.ones((1, config.taxels), bool),
            ready=np.ones(1, np.uint8) if ready is None else np.asarray(ready, np.uint8),
            ack_delay=np.ones(1, np.int64) if ack_delay is None else np.asarray(ack_delay, np.int64),
        )

    def check(self, config: ReadoutConfig) -> None:
        """Refuse a stimulus that does not fit a configuration, in one sentence."""
        samples, clock = self.samples, self.sample_clock
        _check_samples(config, samples)
        if clock.shape != samples.shape[:1] or (np.diff(clock) < 1).any() or (clock < 0).any():
            raise InputError("sample_clock must be one rising clock for every row of samples")
        if self.enable.shape != (len(self.enable_clock), config.taxels) or not len(self.enable_clock):
            raise InputError(f"enable must have shape ({len(self.enable_clock)}, {config.taxels}), one mask at least")
        if self.enable_clock[0] != 0 or (np.diff(self.enable_clock) < 1).any():
            raise InputError("enable_clock must rise from 0")
        if not self.ready.size or not self.ack_delay.size:
            raise InputError("ready and ack_delay must not be empty")
        if (self.ack_delay < 1).any() or (self.ack_delay % link.ACK_QUANTA == 0).any():
            raise InputError("ack_delay must be positive and never a multiple of 8, or ACK changes at a clock edge")


def _check_samples(config: ReadoutConfig, samples: NDArray[Any]) -> None:
    """Refuse samples that are not codes of a configuration's taxels, in one sentence."""
    full_scale = config.full_scale
    if samples.ndim != 2 or samples.shape[1] != config.taxels:
        raise InputError(
            f"samples must have shape (ticks, {config.taxels}) for {config.rows} x {config.columns} "
            f"taxels, not {samples.shape}"
        )
    if not np.issubdtype(samples.dtype, np.integer):
        raise InputError(f"samples must be codes of an integer type, not {samples.dtype}")
    if samples.size and not -full_scale <= samples.min() <= samples.max() < full_scale:
        raise InputError(
            f"samples must be in {-full_scale}..{full_scale - 1} ({config.sample_bits} bits), "
            f"not {samples.min()}..{samples.max()}"
        )


@dataclass(frozen=True)
class State:
    """The registers of a readout just before a clock.

    Attributes
    ----------
    sample, reference, half_width : ndarray of int64, shape (rows, columns)
        Codes; the reference of N-LCS in units of 2**-fraction_bits codes.
    pending, polarity : ndarray of bool, shape (rows, columns)
    latch_row, latch_columns : int
        The burst latch: its row, and its columns as bits.
    behind : int
        Rows, as bits, that come before all others in the next grant.
    """

    sample: NDArray[np.int64]
    reference: NDArray[np.int64]
    half_width: NDArray[np.int64]
    pending: NDArray[np.bool_]
    polarity: NDArray[np.bool_]
    latch_row: int
    latch_columns: int
    behind: int


def simulate(config: ReadoutConfig, stimulus: Stimulus) -> Events:
    """Return the address events of a readout, exactly those of the RTL.

    Parameters
    ----------
    config : ReadoutConfig
    stimulus : Stimulus

    Returns
    -------
    ndarray of EVENT_DTYPE, shape (events,)
        t is the clock of the transfer (stream) or of the edge that raises REQ (four-phase).

    Raises
    ------
    InputError
        If the stimulus does not fit the configuration.

    Examples
    --------
    Two taxels on one link: the arbiter latches both requests at once and sends them one per clock.

    >>> from model.config import ReadoutConfig
    >>> config = ReadoutConfig(rows=1, columns=2, resolution=6, clocks_per_sample=8)
    >>> simulate(config, Stimulus.from_samples(config, np.array([[0, 0], [20, -20]])))
    array([(11, 0, 0,  True), (12, 1, 0, False)],
          dtype=[('t', '<i8'), ('x', '<i2'), ('y', '<i2'), ('p', '?')])
    """
    stimulus.check(config)
    return _run(config, stimulus, stimulus.clocks)[0]


def state_at(config: ReadoutConfig, stimulus: Stimulus, clock: int) -> State:
    """Return the registers of a readout just before a clock of a run."""
    stimulus.check(config)
    _, taxels, rows, latch = _run(config, stimulus, clock)
    shape = (config.rows, config.columns)
    bits = np.arange(config.columns, dtype=np.uint64)
    sample, reference, closed, _ = taxels.reshape(4, *shape)
    return State(
        sample=sample,
        reference=reference,
        half_width=config.step - closed * config.closing_step,
        pending=(rows[0][:, None] >> bits & ONE).astype(bool),
        polarity=(rows[1][:, None] >> bits & ONE).astype(bool),
        latch_row=int(latch[3]),
        latch_columns=int(latch[0]),
        behind=int(latch[2]),
    )


def _run(
    config: ReadoutConfig, stimulus: Stimulus, clocks: int
) -> tuple[Events, NDArray[np.int64], NDArray[np.uint64], NDArray[np.uint64]]:
    """Run the loop; return events, taxel registers (4, taxels), row words (3, rows), latch words (4,)."""
    taxels = np.zeros((4, config.taxels), np.int64)
    rows = np.zeros((3, config.rows), np.uint64)
    latch = np.zeros(4, np.uint64)
    time, index, polarity = _loop(
        _ENCODING[config.encoding],
        config.decide_every == "sample",
        config.frontend == "digital",
        config.link == "four_phase",
        config.columns,
        config.reference_reset << (config.fraction_bits if config.encoding == "nlcs" else 0),
        config.step,
        config.closing_step,
        1 << config.closing_levels_log2,
        config.window_period,
        config.leak_shift,
        config.leak_period,
        config.fraction_bits,
        decay_phases(config),
        np.ascontiguousarray(stimulus.samples, np.int32),
        stimulus.sample_clock,
        stimulus.enable_clock,
        stimulus.enable,
        stimulus.ready,
        stimulus.ack_delay,
        clocks,
        taxels,
        rows,
        latch,
        link.new_state(),
    )
    events = np.empty(len(time), EVENT_DTYPE)
    events["t"], events["p"] = time, polarity
    events["y"], events["x"] = np.divmod(index, config.columns)
    return events, taxels, rows, latch


@njit(cache=True)
def _loop(
    encoding: int,
    per_sample: bool,
    digital: bool,
    four_phase: bool,
    columns: int,
    reset: int,
    step: int,
    closing_step: int,
    levels: int,
    window_period: int,
    leak_shift: int,
    leak_period: int,
    fraction_bits: int,
    phases: NDArray[np.int64],
    samples: NDArray[np.int32],
    sample_clock: NDArray[np.int64],
    enable_clock: NDArray[np.int64],
    enable: NDArray[np.bool_],
    ready: NDArray[np.uint8],
    ack_delay: NDArray[np.int64],
    clocks: int,
    taxels: NDArray[np.int64],
    rows: NDArray[np.uint64],
    latch: NDArray[np.uint64],
    aer: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.bool_]]:
    x, u, closed, quiet = taxels[0], taxels[1], taxels[2], taxels[3]
    pending, polarity, active = rows[0], rows[1], rows[2]
    u[:] = reset
    n_rows, n_ticks = len(pending), len(sample_clock)
    again = np.zeros(n_rows, np.uint64)  # taxels that must decide once more in the next clock
    any_again = False
    # The latch: its columns, their polarities, the rows behind its row, and its row.
    waiting, signs, behind, latched = ZERO, ZERO, ZERO, 0
    requests = ZERO  # rows with a pending request
    ticks = changes = 0  # sample ticks and masks so far
    tick = False
    events = 0
    time = np.empty(1024, np.int64)
    index = np.empty(1024, np.int32)
    sign = np.empty(1024, np.bool_)
    link_row, link_column, link_sign = 0, 0, False

    t = 0
    while t < clocks:
        # The mask. A disabled taxel is reset; all decide once more, which changes nothing for the others.
        decide_all = tick or t == 0
        if changes < len(enable_clock) and enable_clock[changes] == t:
            for r in range(n_rows):
                active[r] = ZERO
                for c in range(columns):
                    i = r * columns + c
                    if enable[changes, i]:
                        active[r] |= ONE << np.uint64(c)
                    else:
                        u[i], closed[i], quiet[i] = reset, 0, 0
                        if digital:
                            x[i] = 0
                pending[r] &= active[r]
                polarity[r] &= active[r]
                if pending[r] == ZERO:
                    requests &= ~(ONE << np.uint64(r))
            changes += 1
            decide_all = True

        # Transfer, and the grant of the next row.
        take = waiting != ZERO and (link.ready(aer) if four_phase else ready[t % len(ready)] != 0)
        if take:
            column = lowest(waiting)
            on = signs >> np.uint64(column) & ONE != ZERO
            if four_phase:
                link_row, link_column, link_sign = latched, column, on
            else:
                if events == len(time):
                    time, index, sign = _grown(time), _grown(index), _grown(sign)
                time[events], index[events], sign[events] = t, latched * columns + column, on
                events += 1
            waiting = without_lowest(waiting)
        taken_row, taken = 0, ZERO
        if waiting == ZERO and requests != ZERO:
            taken_row = next_row(requests, behind)
            taken = pending[taken_row]
            waiting, signs, latched, behind = taken, polarity[taken_row], taken_row, rows_behind(taken_row)
            pending[taken_row] = ZERO
            requests &= ~(ONE << np.uint64(taken_row))

        # The taxels that have to decide: all, or those whose request was taken or whose threshold moved.
        if decide_all or taken != ZERO or any_again:
            any_again = False
            first, last = (0, n_rows) if decide_all or again.any() else (taken_row, taken_row + 1)
            for r in range(first, last):
                todo = active[r] & ~pending[r]
                if not decide_all:
                    todo &= again[r] | (taken if r == taken_row else ZERO)
                again[r] = ZERO
                leaks = tick and encoding == N_LCS and (ticks - 1) % leak_period == phases[r]
                while todo != ZERO:
                    c = lowest(todo)
                    bit = ONE << np.uint64(c)
                    todo = without_lowest(todo)
                    i = r * columns + c
                    on = off = moved = False
                    decides = tick or not per_sample
                    if encoding == N_LCS:
                        on = decides and (x[i] << fraction_bits) - u[i] > step << fraction_bits
                        leak = (u[i] + (1 << (leak_shift - 1))) >> leak_shift if leaks else 0
                        u[i] += (step << fraction_bits if on else 0) - leak
                        moved = leaks
                    else:
                        h = step if encoding == LCS else step - closed[i] * closing_step
                        on = decides and x[i] - u[i] >= h
                        off = decides and x[i] - u[i] < -h
                        if on or off:
                            u[i] += h if on else -h
                            closed[i] = quiet[i] = 0
                        elif tick and encoding == CW_LCS:
                            quiet[i] += 1
                            if quiet[i] == window_period:
                                quiet[i] = 0
                                moved = closed[i] < levels - 1
                                closed[i] += 1 if moved else 0
                    if on or off:
                        pending[r] |= bit
                        polarity[r] = polarity[r] | bit if on else polarity[r] & ~bit
                        requests |= ONE << np.uint64(r)
                    elif moved and not per_sample:
                        again[r] |= bit
                        any_again = True

        # The samples, compared from the next clock on.
        tick = ticks < n_ticks and sample_clock[ticks] == t
        if tick:
            for r in range(n_rows):
                for c in range(columns):
                    if not digital or active[r] >> np.uint64(c) & ONE != ZERO:
                        x[r * columns + c] = samples[ticks, r * columns + c]
            ticks += 1

        if four_phase and link.advance(aer, t, take, ack_delay) and t + 1 < clocks:
            if events == len(time):
                time, index, sign = _grown(time), _grown(index), _grown(sign)
            time[events], index[events], sign[events] = t, link_row * columns + link_column, link_sign
            events += 1

        t += 1
        if waiting == ZERO and requests == ZERO and not tick and not any_again and (not four_phase or link.ready(aer)):
            until = clocks
            if ticks < n_ticks:
                until = min(until, sample_clock[ticks])
            if changes < len(enable_clock):
                until = min(until, enable_clock[changes])
            t = max(t, until)

    latch[0], latch[1], latch[2], latch[3] = waiting, signs, behind, np.uint64(latched)
    return time[:events], index[:events], sign[:events]


@njit(cache=True)
def _grown(array: NDArray[Any]) -> NDArray[Any]:
    """Return a copy of an array with room for twice as many."""
    grown = np.empty(2 * len(array), array.dtype)
    grown[: len(array)] = array
    return grown
