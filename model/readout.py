"""Golden model of the RTL: a cycle-accurate simulation of taxel array, arbiter and link.

The loop visits only the clocks in which something can change. This is exact: a taxel without an event decides the same
again until its sample, its reference or its window moves.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.files import forget_stale_kernels
from eskin.model import arbiter, decay
from eskin.model import taxel_kernels as taxel
from eskin.model.address_events import Events, make_events
from eskin.model.arbiter import ONE, ZERO, lowest, without_lowest
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import compiled, fields
from eskin.model.encoders.fields import ANALOG_RANGE
from eskin.model.links import compiled as links
from eskin.model.links.link import ACK_QUANTA, NOTHING, Sink
from eskin.model.registers import pattern, settings
from eskin.model.taxel_kernels import Parameters

SOURCES = (
    *compiled.sources(),
    *links.sources(),
    *(Path(str(m.__file__)) for m in (arbiter, pattern, settings, taxel)),
)
"""Files and folders with code that the compiled loop of this file contains."""
forget_stale_kernels(Path(__file__), SOURCES)

TAKEN, WAITED = 1, 2


@dataclass(frozen=True)
class Stimulus:
    """The inputs of a readout, starting at the end of reset."""

    samples: NDArray[np.int32]
    """Codes at every sample tick, before receptive fields; an analog signal may be up to four times full scale.

    Shape (ticks, taxels).
    """
    sample_clock: NDArray[np.int64]  # clock of every sample tick, rising, shape (ticks,)
    clocks: int
    """Length of the run; actions in this clock or later are ignored (a REQ that rises at an edge is seen in the next
    clock)."""
    enable_clock: NDArray[np.int64]  # clocks from which the masks are valid, the first 0, shape (changes,)
    enable: NDArray[np.bool_]  # masks, shape (changes, taxels)
    ready: NDArray[np.uint8] = field(default_factory=lambda: np.ones(1, np.uint8))
    """``event_ready`` per clock, repeated (stream link), shape (pattern,)."""
    ack_delay: NDArray[np.int64] = field(default_factory=lambda: np.ones(1, np.int64))
    """From each edge of REQ to that of ACK in 1/8 clock, repeated, never a multiple of 8 (four-phase link)."""
    decisions: NDArray[np.uint8] | None = None
    """Decisions of the comparators in every clock, 1 for above and 2 for below, shape (clocks, taxels) (analog front
    end), for comparators with offset, noise or hysteresis. By default they follow from the samples."""
    settings: NDArray[np.void] = field(default_factory=lambda: np.zeros(0, settings.SETTING_DTYPE))
    """Settings of a host, and the clocks from which they are valid; the first at clock 0 (``registers="spi"``)."""
    choice_clock: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    choice: NDArray[np.uint8] = field(default_factory=lambda: np.zeros((0, 0), np.uint8))
    """Fields that a host chooses, by their numbers in ``fields.CHOICES``, shape (changes, taxels), and the clocks from
    which they are valid; the first at clock 0 (``receptive_fields="settable"``). By default all are ``own``. A mask
    silences taxels that are off."""
    write_clock: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """Clocks in which ``compare`` is high because a host wrote a register two clocks earlier, rising, shape (writes,)
    (analog front end with ``registers="spi"``)."""

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
        """Return a stimulus of samples, shape (ticks, taxels), at a constant rate, with all taxels enabled.

        By default the run ends one sample period after the last sample, the sink is always ready, and ACK follows in
        1/8 clock.
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
        """Check that a stimulus fits a configuration."""
        samples, clock = self.samples, self.sample_clock
        _check_samples(config, samples)
        if clock.shape != samples.shape[:1] or (np.diff(clock) < 1).any() or (clock < 0).any():
            raise InputError("sample_clock must be one rising clock for every row of samples")
        if self.enable.shape != (len(self.enable_clock), config.taxels) or not len(self.enable_clock):
            raise InputError(f"enable must have shape ({len(self.enable_clock)}, {config.taxels}), one mask at least")
        if self.enable_clock[0] != 0 or (np.diff(self.enable_clock) < 1).any():
            raise InputError("enable_clock must rise from 0")
        if self.decisions is not None:
            if config.frontend != "analog":
                raise InputError("decisions need the analog front end; set frontend to analog")
            if self.decisions.shape != (self.clocks, config.taxels):
                raise InputError(f"decisions must have shape ({self.clocks}, {config.taxels}), a row for every clock")
        settings.check(config, self.settings)
        if len(self.choice_clock):
            if config.receptive_fields != fields.SETTABLE:
                raise InputError(f"a choice needs receptive_fields {fields.SETTABLE}, not {config.receptive_fields}")
            if self.choice.shape != (len(self.choice_clock), config.taxels) or self.choice.max() >= len(fields.CHOICES):
                raise InputError(f"choice must have shape ({len(self.choice_clock)}, {config.taxels}), values 0..3")
            if self.choice_clock[0] != 0 or (np.diff(self.choice_clock) < 1).any():
                raise InputError("choice_clock must rise from 0")
        if not self.ready.size or not self.ack_delay.size:
            raise InputError("ready and ack_delay must not be empty")
        if (self.ack_delay < 1).any() or (self.ack_delay % ACK_QUANTA == 0).any():
            raise InputError("ack_delay must be positive and never a multiple of 8, or ACK changes at a clock edge")


def _check_samples(config: ReadoutConfig, samples: NDArray[Any]) -> None:
    full_scale = config.full_scale * (ANALOG_RANGE if config.frontend == "analog" else 1)
    if samples.ndim != 2 or samples.shape[1] != config.taxels:
        raise InputError(
            f"samples must have shape (ticks, {config.taxels}) for {config.rows} x {config.columns} "
            f"taxels, not {samples.shape}"
        )
    if not np.issubdtype(samples.dtype, np.integer):
        raise InputError(
            f"samples must be integer codes, not {samples.dtype}; eskin.encode takes floats in full scales"
        )
    if samples.size and not -full_scale <= samples.min() <= samples.max() < full_scale:
        raise InputError(
            f"samples must be in {-full_scale}..{full_scale - 1} ({config.sample_bits} bits), "
            f"not {samples.min()}..{samples.max()}"
        )


@dataclass(frozen=True)
class State:
    """The registers of a readout just before a clock; arrays have the shape (rows, columns)."""

    sample: NDArray[np.int64]  # codes
    reference: NDArray[np.int64]  # codes; of an encoder that leaks, in units of 2**-fraction_bits codes
    half_width: NDArray[np.int64]  # codes
    pending: NDArray[np.bool_]
    polarity: NDArray[np.bool_]
    latch_row: int  # row of the burst latch
    latch_columns: int  # its columns as bits
    behind: int  # rows, as bits, that come before all others in the next grant


def simulate(config: ReadoutConfig, stimulus: Stimulus) -> Events:
    """Return the address events of a readout, equal to those of the RTL.

    t is the clock of the transfer (stream) or of the edge that raises REQ (four-phase).

    Examples
    --------
    Two taxels on one link: the arbiter latches both requests at once and sends them one per clock.

    >>> from eskin.model.config import ReadoutConfig
    >>> config = ReadoutConfig(rows=1, columns=2, resolution=6, clocks_per_sample=8)
    >>> simulate(config, Stimulus.from_samples(config, np.array([[0, 0], [20, -20]])))
    array([(11, 0, 0,  True), (12, 1, 0, False)],
          dtype=[('t', '<i8'), ('x', '<i2'), ('y', '<i2'), ('p', '?')])
    """
    stimulus.check(config)
    return _run(config, stimulus, stimulus.clocks)[0]


def simulate_counted(config: ReadoutConfig, stimulus: Stimulus) -> tuple[Events, NDArray[np.uint8]]:
    """Return the events, and the state of the arbiter's output in every clock, shape (clocks,).

    0: nothing was offered, 1: an event was taken (``TAKEN``), 2: one waited (``WAITED``).
    """
    stimulus.check(config)
    traffic = np.zeros(stimulus.clocks, np.uint8)
    return _run(config, stimulus, stimulus.clocks, traffic)[0], traffic


def strobes(config: ReadoutConfig, stimulus: Stimulus) -> NDArray[np.bool_]:
    """Return ``compare`` of every taxel in every clock, shape (clocks, taxels) (analog front end)."""
    lines = _strobes(config, stimulus)[:, :, None] >> np.arange(config.columns, dtype=np.uint64) & ONE
    return lines.astype(bool).reshape(stimulus.clocks, config.taxels)


def comparisons(config: ReadoutConfig, stimulus: Stimulus) -> int:
    """Return the number of strobes of all taxels, the measure of the comparators' energy (analog front end).

    A strobe is a clock in which ``compare`` of one taxel is high: one decision of its comparator, or of both with
    polarity.
    """
    return int(np.bitwise_count(_strobes(config, stimulus)).sum())


def _strobes(config: ReadoutConfig, stimulus: Stimulus) -> NDArray[np.uint64]:
    """Return ``compare`` in every clock, a bit for each column, shape (clocks, rows)."""
    if config.frontend != "analog":
        raise InputError(f"strobes need the analog front end; set frontend to analog, not {config.frontend}")
    stimulus.check(config)
    asked = np.zeros((stimulus.clocks, config.rows), np.uint64)
    _run(config, stimulus, stimulus.clocks, asked=asked)
    return asked


def state_at(config: ReadoutConfig, stimulus: Stimulus, clock: int) -> State:
    """Return the registers of a readout just before a given clock of a run."""
    stimulus.check(config)
    _, registers = _run(config, stimulus, clock)
    taxels = registers.taxels.reshape(config.rows, config.columns)
    bits = np.arange(config.columns, dtype=np.uint64)
    return State(
        sample=taxels["x"],
        reference=taxels["u"],
        half_width=config.encoder.half_width(config, taxels),
        pending=(registers.rows["pending"][:, None] >> bits & ONE).astype(bool),
        polarity=(registers.rows["polarity"][:, None] >> bits & ONE).astype(bool),
        latch_row=int(registers.latch[arbiter.ROW]),
        latch_columns=int(registers.latch[arbiter.WAITING]),
        behind=int(registers.latch[arbiter.BEHIND]),
    )


class Inputs(NamedTuple):
    """The stimulus as a tuple for the compiled loop: the attributes of ``Stimulus``, and the leak phase of every row.

    ``samples`` are the signals of the fields. ``decisions`` has no rows without decisions. ``shown`` has a row of
    analog signals for every choice of fields in ``choice_clock``.
    """

    samples: NDArray[np.int32]
    sample_clock: NDArray[np.int64]
    clocks: int
    enable_clock: NDArray[np.int64]
    enable: NDArray[np.bool_]
    sink: Sink
    phases: NDArray[np.int64]
    decisions: NDArray[np.uint8]
    choice_clock: NDArray[np.int64]
    shown: NDArray[np.int32]
    write_clock: NDArray[np.int64]


class Registers(NamedTuple):
    """All registers of a readout except the decay tick counter; see ``taxel_kernels``, ``arbiter`` and ``links``."""

    taxels: NDArray[np.void]
    rows: NDArray[np.void]
    latch: NDArray[np.uint64]
    link: NDArray[np.int64]

    @classmethod
    def after_reset(cls, config: ReadoutConfig) -> Registers:
        """Return the registers after reset."""
        taxels = np.zeros(config.taxels, taxel.taxel_dtype(config))
        taxels["u"] = Parameters.of(config).reset
        taxels["given"] = -1
        return cls(taxels, np.zeros(config.rows, arbiter.ROW_DTYPE), arbiter.new_state(), config.protocol.new_state())


def _run(
    config: ReadoutConfig,
    stimulus: Stimulus,
    clocks: int,
    traffic: NDArray[np.uint8] | None = None,
    asked: NDArray[np.uint64] | None = None,
) -> tuple[Events, Registers]:
    """Run the compiled loop for a number of clocks; return the events and the final registers."""
    registers = Registers.after_reset(config)
    inputs = Inputs(
        _signals(config, stimulus),
        stimulus.sample_clock,
        clocks,
        stimulus.enable_clock,
        stimulus.enable & ~fields.is_off(config),
        Sink(stimulus.ready, stimulus.ack_delay),
        decay.decay_phases(config),
        _decisions(config, stimulus),
        *_shown(config, stimulus),
        stimulus.write_clock,
    )
    given_settings = stimulus.settings if len(stimulus.settings) else None
    traffic = np.zeros(0, np.uint8) if traffic is None else traffic
    asked = np.zeros((0, 0), np.uint64) if asked is None else asked
    rules = Parameters.of(config), config.protocol.rule()
    time, event = _loop(*rules, inputs, registers, given_settings, traffic, asked).T
    row, column = np.divmod(event >> 1, config.columns)
    return make_events(time, row, column, event & 1), registers


def _signals(config: ReadoutConfig, stimulus: Stimulus) -> NDArray[np.int32]:
    """Return the inputs of the encoders for every sample, shape (ticks, taxels)."""
    if not len(stimulus.choice_clock):
        return np.ascontiguousarray(fields.seen(config, stimulus.samples), np.int32)
    now = np.searchsorted(stimulus.choice_clock, stimulus.sample_clock, side="right") - 1
    return np.ascontiguousarray(fields.chosen(config, stimulus.samples, stimulus.choice[now]), np.int32)


def _shown(config: ReadoutConfig, stimulus: Stimulus) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Return the analog inputs of the comparators, and the clocks in which a host's choice of fields changes them."""
    clock = stimulus.choice_clock
    if not len(clock) or config.frontend == "digital":
        return np.zeros(0, np.int64), np.zeros((0, 0), np.int32)
    last = np.searchsorted(stimulus.sample_clock, clock)  # samples before that clock
    samples = np.concatenate([np.zeros((1, config.taxels), np.int32), stimulus.samples])[last]
    return clock, np.ascontiguousarray(fields.chosen(config, samples, stimulus.choice), np.int32)


def _decisions(config: ReadoutConfig, stimulus: Stimulus) -> NDArray[np.uint8]:
    """Return the outputs of the comparators; without polarity there is no lower comparator."""
    if stimulus.decisions is None:
        return np.zeros((0, 0), np.uint8)
    return stimulus.decisions & np.uint8(3 if config.has_polarity else 1)


@njit(cache=True, nogil=True)
def _loop(p: Any, link: Any, s: Inputs, r: Registers, given_settings: Any, traffic: Any, asked: Any) -> Any:
    """Simulate the readout; return the clock and 2 * taxel + polarity of every event, shape (events, 2).

    Settings are None without a host: the compiled loop then has no code for settings. ``traffic`` takes the states that
    ``simulate_counted`` returns, and ``asked`` the rows' ``compare``, if they have room.
    """
    taxels, rows, latch, sender = r
    samples, sample_clock, clocks, enable_clock, enable, sink, phases, decisions, choice_clock, shown, write_clock = s
    log = np.empty((1024, 2), np.int64)
    # events, sample ticks, masks, choices of fields, and writes of a host so far
    events = ticks = changes = choices = writes = 0
    again: Any = np.bool_(False)  # no literal, for which Numba would compile ``decide`` once more
    tick = again
    host = settings.new_host()
    t = 0
    while t < clocks:
        moved = testing = False
        if writes < len(write_clock) and write_clock[writes] == t:
            writes += 1
            if not p.per_sample:
                ask(p, rows)
                again = True
        if len(asked):
            for y in range(len(rows)):
                asked[t, y] = rows[y].again
        if given_settings is not None:
            moved, testing = settings.apply(host, given_settings, t, ticks, rows, latch)
            if moved:
                p = _set(p, given_settings[host[settings.NUMBER] - 1])
                settings.set_phases(phases, p.rule.leak_period)

        # A mask resets the disabled taxels. All taxels decide once more, which changes nothing for the others.
        masked = changes < len(enable_clock) and enable_clock[changes] == t
        if masked:
            mask_rows(p, enable[changes], taxels, rows, latch)
            changes += 1

        if choices < len(choice_clock) and choice_clock[choices] == t:
            take_samples(p, shown[choices], taxels, rows)
            choices, moved = choices + 1, True

        # Transfer, and the grant of the next row.
        take = arbiter.offers(latch) and links.ready(link, sender, sink, t)
        taken = arbiter.take(latch, p.columns) if take else np.int64(NOTHING)
        if len(traffic):
            traffic[t] = TAKEN if take else WAITED if arbiter.offers(latch) else 0
        row = arbiter.grant(latch, rows)
        if given_settings is not None:
            settings.advance(host, given_settings, p.columns, row, rows, latch)

        # The taxels that have to decide: all, or those whose request was taken or whose threshold moved.
        if len(decisions) > 0:
            for number in range(len(taxels)):
                taxels[number].given = decisions[t, number]
        everyone = tick or (p.digital and (masked or moved or t == 0))
        if everyone or again or row >= 0:
            first, last = (0, len(rows)) if everyone or again else (row, row + 1)
            again = False
            for y in range(first, last):
                leaks = tick and p.leaks and settings.leaks(host, p, phases[y], ticks)
                todo = rows[y].again | (latch[arbiter.TAKEN] if y == row else ZERO)
                again |= decide(p, y, ~ZERO if everyone else todo, tick, leaks, taxels, rows, latch)
        if masked:
            again |= ask_fresh(p, rows)

        # The samples, compared from the next clock on.
        tick = ticks < len(sample_clock) and sample_clock[ticks] == t
        if tick:
            take_samples(p, samples[ticks], taxels, rows)
            ticks += 1
            ask(p, rows)
        left = links.advance(link, sender, sink, t, taken)
        if left != NOTHING and t + link.late < clocks:
            log = with_room(log, events)
            log[events, 0], log[events, 1] = t, left
            events += 1

        t += 1
        still = arbiter.idle(latch) and not tick and not again and not testing
        if still and links.rests(link, sender):
            until = sample_clock[ticks] if ticks < len(sample_clock) else clocks
            if changes < len(enable_clock):
                until = min(until, enable_clock[changes])
            if choices < len(choice_clock):
                until = min(until, choice_clock[choices])
            if writes < len(write_clock):
                until = min(until, write_clock[writes])
            if given_settings is not None:
                until = min(until, settings.next_change(host, given_settings, clocks))
            t = max(t, min(until, clocks))
    return log[:events]


@njit(inline="always")
def _set(p: Parameters, now: Any) -> Parameters:
    """Return the loop parameters changed by the settings of a host."""
    return Parameters(*p[:-1], compiled.with_settings(p.rule, now))


@njit(cache=True, forceinline=True)  # inlined by LLVM: compiled once, not once more for every link and host
def decide(p: Any, y: int, todo: Any, tick: bool, leaks: bool, taxels: Any, rows: Any, latch: Any) -> bool:
    """Compute the decisions of the taxels of row y; return True if another decision follows in the next clock.

    Of the taxels in ``todo`` those decide that have no request, or whose request is taken in this clock. ``tick`` and
    ``leaks`` are true in the clock of a sample tick, and of a leak of the row. Analog comparators count only in asked
    taxels. They are asked again after an event or a move of a threshold, and while a request waits as long as they
    answer with a step.
    """
    todo &= rows[y].active
    waiting, asked = rows[y].pending, rows[y].again
    todo &= ~waiting | (ZERO if p.digital else asked)
    again = ZERO
    while todo != ZERO:
        column = lowest(todo)
        bit = ONE << np.uint64(column)
        todo = without_lowest(todo)
        own = taxels[y * p.columns + column]
        if waiting & bit != ZERO:
            on, off = taxel.steps(p, own)
            moved = False
        else:
            looks = tick or not p.per_sample if p.digital else asked & bit != ZERO
            on, off, moved = taxel.decide(p, own, looks, tick, leaks)
            if on or off:
                rows[y].pending |= bit
                rows[y].polarity = rows[y].polarity | bit if on else rows[y].polarity & ~bit
                arbiter.request(latch, y)
        if (moved or (not p.digital and (on or off))) and not p.per_sample:
            again |= bit
    rows[y].again = again
    return again != ZERO


@njit(cache=True, nogil=True)
def ask(p: Any, rows: Any) -> None:
    """Ask the analog comparators of all enabled taxels in the next clock."""
    for y in range(0 if p.digital else len(rows)):
        rows[y].again |= rows[y].active


@njit(cache=True, nogil=True)
def ask_fresh(p: Any, rows: Any) -> bool:
    """Ask the analog comparators of taxels whose mask ends in this clock; return True if there are any."""
    found = False
    for y in range(0 if p.digital or p.per_sample else len(rows)):
        rows[y].again |= rows[y].fresh
        found |= rows[y].fresh != ZERO
    return found


@njit(cache=True, nogil=True)
def mask_rows(p: Any, enable: Any, taxels: Any, rows: Any, latch: Any) -> None:
    """Apply a new mask, which holds disabled taxels in reset."""
    for y in range(len(rows)):
        active = ZERO
        for column in range(p.columns):
            if enable[y * p.columns + column]:
                active |= ONE << np.uint64(column)
            else:
                taxel.reset(p, taxels[y * p.columns + column])
        rows[y].fresh = active & ~rows[y].active
        rows[y].active = active
        rows[y].pending &= active
        if rows[y].pending == ZERO:
            arbiter.withdraw(latch, y)


@njit(cache=True, nogil=True)
def take_samples(p: Any, samples: Any, taxels: Any, rows: Any) -> None:
    """Store new samples, except in disabled taxels with a digital front end."""
    for y in range(len(rows)):
        for column in range(p.columns):
            if not p.digital or rows[y].active >> np.uint64(column) & ONE != ZERO:
                taxels[y * p.columns + column].x = samples[y * p.columns + column]


@njit(cache=True, nogil=True)
def with_room(log: NDArray[Any], events: int) -> NDArray[Any]:
    """Return an event log with room for one more event."""
    if events < len(log):
        return log
    longer = np.empty((2 * len(log), 2), log.dtype)
    for row in range(len(log)):  # an assignment of the whole array would take Numba seconds to compile
        longer[row, 0], longer[row, 1] = log[row, 0], log[row, 1]
    return longer
