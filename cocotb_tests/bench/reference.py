"""Simple reference model of the readout in plain Python, one clock at a time.

Written only from docs/specification.md and docs/design/microarchitecture.md, as a reference for the clock-skipping
model and the RTL. Properties and methods give the outputs of a block just before a rising edge, and ``clock`` applies
the edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Literal, NamedTuple

from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import ANALOG_RANGE, fields_of

if TYPE_CHECKING:  # importing it would compile the fast model in every simulator
    from eskin.model.readout import Stimulus


class AddressEvent(NamedTuple):
    """Address of an event; events of a unipolar encoder are ON."""

    row: int
    column: int
    polarity: bool


class TimedEvent(NamedTuple):
    """Address event with the clock of its transfer."""

    clock: int
    row: int
    column: int
    polarity: bool


Requests = Sequence[Sequence[bool | None]]
"""Polarity of the pending request of every row and column; None without a request."""


KNOWN = {"lcs", "cw-lcs", "nlcs", "nlcs-bipolar"}
"""Encoders that ``TaxelReference`` plays; it would play any other encoder as LCS."""


class TaxelReference:
    """Reference model of one taxel."""

    def __init__(self, config: ReadoutConfig) -> None:
        if config.encoder.name not in KNOWN:
            raise NotImplementedError(f"{__name__} has no rule for the encoder {config.encoding}")
        self.config = config
        self.unit = 2**config.fraction_bits if config.encoder.leaks else 1
        self.step = 2 ** (config.sample_bits - 2 - config.resolution)
        self.closing_step = max(self.step >> config.closing_shift, 1)
        self.reset()

    def reset(self) -> None:
        """Reset the taxel."""
        self.sample = 0  # the newest, in codes (digital front end)
        self.reference = self.config.reference_reset * self.unit  # in codes; for N-LCS in 2**-fraction_bits codes
        self.pending = False
        self.polarity = False  # of the last request
        self.closed = 0  # closing steps taken off the half-width
        self.quiet_ticks = 0  # sample ticks since the last closing step or event

    def request(self, enable: bool) -> bool:
        """Return the level of the request line."""
        return self.pending and enable

    @property
    def half_width(self) -> int:
        """Half-width h of the window in codes: D minus the closing steps (CW-LCS)."""
        return self.step - self.closed * self.closing_step

    @property
    def upper(self) -> int:
        """Smallest code that causes an ON event."""
        return self.reference // self.unit + self.half_width + self.config.encoder.strict

    @property
    def lower(self) -> int:
        """Smallest code that causes no OFF event."""
        return self.reference // self.unit - self.half_width

    def on_scale(self, reference: int) -> bool:
        """Return True if a reference is within full scale."""
        full_scale = 2 ** (self.config.sample_bits - 1)
        return -full_scale <= reference // self.unit < full_scale

    def compare(self, x: int) -> tuple[bool, bool]:
        """Return whether a code causes an ON event, and whether it causes an OFF event."""
        difference, h = x - self.reference // self.unit, self.half_width
        above = difference > h if self.config.encoder.strict else difference >= h
        return above, self.config.has_polarity and difference < -h

    def comparators(self, x: int) -> tuple[bool, bool]:
        """Return the outputs of the analog comparators: x >= upper, and with polarity x < lower."""
        return x >= self.upper, self.config.has_polarity and x < self.lower

    def clock(
        self,
        *,
        enable: bool,
        tick: bool,
        granted: bool,
        decay: bool = False,
        sample: int | None = None,
        decision: tuple[bool, bool] | None = None,
    ) -> None:
        """Apply a rising edge.

        ``tick`` is the sample tick, the clock after ``sample_valid``, and ``decay`` a decay tick of the row (N-LCS). A
        new ``sample`` is for the digital front end. The analog one has a ``decision``: x >= upper, and x < lower.
        """
        if not enable:
            self.reset()
            return
        above, below = self.compare(self.sample) if decision is None else decision
        if not self.pending or granted:
            decides = tick or self.config.decide_every == "clock"
            rise = self.half_width * self.unit
            on = decides and above and self.on_scale(self.reference + rise)
            off = decides and below and not above and self.on_scale(self.reference - rise)
            self._move(on, off, tick, decay)
            self.pending = on or off
            if self.pending:
                self.polarity = on
        if sample is not None:
            self.sample = sample

    def _move(self, on: bool, off: bool, tick: bool, decay: bool) -> None:
        """Move reference and window after a decision."""
        if self.config.encoder.leaks:
            divisor = 2**self.config.leak_shift
            inward = off if self.reference >= 0 else on  # a step towards zero replaces the leak
            leak = (2 * self.reference + divisor) // (2 * divisor) if decay and not inward else 0  # rounded half up
            self.reference += (on - off) * self.step * self.unit - leak
            return
        if on:
            self.reference += self.half_width
        elif off:
            self.reference -= self.half_width
        if self.config.encoder.windowed:
            if on or off:
                self.closed = self.quiet_ticks = 0
            elif tick:
                self.quiet_ticks += 1
                if self.quiet_ticks == self.config.window_period:
                    self.quiet_ticks = 0
                    self.closed = min(self.closed + 1, self.step // self.closing_step - 1)


class ArbiterReference:
    """Reference model of the arbiter: round robin over rows, one event per clock in rising column order."""

    def __init__(self, config: ReadoutConfig) -> None:
        self.config = config
        self.reset()

    def reset(self) -> None:
        """Reset the arbiter."""
        self.last: int | None = None  # the row last granted
        self.latch: list[AddressEvent] = []  # the next event first

    @property
    def event(self) -> AddressEvent | None:
        """The offered event, or None."""
        return self.latch[0] if self.latch else None

    def selected(self, requests: Requests) -> int | None:
        """Return the row to grant next: round robin, starting behind the last granted row."""
        rows = self.config.rows
        start = 0 if self.last is None else self.last + 1
        for row in [*range(start, rows), *range(min(start, rows))]:
            if any(polarity is not None for polarity in requests[row]):
                return row
        return None

    def granted(self, requests: Requests, ready: bool) -> int | None:
        """Return the row granted in this clock, or None."""
        if not self.latch or (len(self.latch) == 1 and ready):
            return self.selected(requests)
        return None

    def clock(self, requests: Requests, ready: bool) -> None:
        """Apply a rising edge."""
        row = self.granted(requests, ready)
        if self.latch and ready:
            self.latch.pop(0)
        if row is not None:
            self.last = row
            for column, polarity in enumerate(requests[row]):
                if polarity is not None:
                    self.latch.append(AddressEvent(row, column, polarity))


class LinkReference:
    """Reference model of the four-phase link."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Reset the link."""
        self.state: Literal["idle", "set up", "request"] = "idle"
        self.address: AddressEvent | None = None  # all lines are zero after reset
        self.flops = [True, True]  # of the synchroniser; the last one is what the link sees

    @property
    def ready(self) -> bool:
        """True if the link accepts an event in this clock."""
        return self.state == "idle" and not self.flops[-1]

    @property
    def req(self) -> bool:
        """Level of aer_req."""
        return self.state == "request"

    def clock(self, event: AddressEvent | None, ack: bool) -> None:
        """Apply a rising edge with the offered event, or None, and the level of aer_ack."""
        if self.ready:
            if event is not None:
                self.address = event
                self.state = "set up"
        elif self.state == "set up":
            self.state = "request"
        elif self.state == "request" and self.flops[-1]:
            self.state = "idle"
        self.flops = [ack, self.flops[0]]


class ReceiverReference:
    """Reference model of an asynchronous receiver: ACK follows every edge of REQ after a delay.

    The delays, in 1/8 clock, are used cyclically, and are never a multiple of 8.
    """

    def __init__(self, delays: Sequence[int]) -> None:
        self.delays = delays
        self.edges = 0
        self.req = self.ack = False
        self.at = 0  # when ACK follows, in 1/8 clock

    def ack_at(self, clock: int) -> bool:
        """Return the level of ACK just before a clock edge."""
        if self.ack != self.req and 8 * clock > self.at:
            self.ack = self.req
        return self.ack

    def see(self, req: bool, clock: int) -> None:
        """Sample REQ just after a clock edge."""
        if req != self.req:
            self.req = req
            self.at = 8 * clock + self.delays[self.edges % len(self.delays)]
            self.edges += 1


class ReadoutReference:
    """Reference model of array, arbiter and link."""

    def __init__(self, config: ReadoutConfig, ack_delay: Sequence[int] = (1,)) -> None:
        self.config = config
        self.fields = fields_of(config)
        self.taxels = [[TaxelReference(config) for _ in range(config.columns)] for _ in range(config.rows)]
        self.signal = [[0] * config.columns for _ in range(config.rows)]  # of the last tick, for analog comparators
        self.arbiter = ArbiterReference(config)
        self.link = LinkReference()
        self.receiver = ReceiverReference(ack_delay)
        self.tick = False
        self.time = self.ticks = 0
        self.raised: list[TimedEvent] = []  # requests, and the first clock in which they are high
        self.accepted: list[TimedEvent] = []  # events, and the clock in which they left the arbiter

    def seen(self, sample: Sequence[int]) -> list[int]:
        """Return the inputs of the encoders: mean or sum of each field, rounded half to even, saturated."""
        most = 2 ** (self.config.sample_bits - 1) * (ANALOG_RANGE if self.config.frontend == "analog" else 1)
        exact = [Fraction(sum(sample[i] for i in field.taxels), 2**field.shift) for field in self.fields]
        return [min(max(round(value), -most), most - 1) for value in exact]

    def requests(self, enable: Sequence[bool]) -> Requests:
        """Return the pending requests of enabled taxels."""
        columns = self.config.columns
        return [
            [
                (taxel.polarity if self.config.has_polarity else True)
                if taxel.request(enable[row * columns + column])
                else None
                for column, taxel in enumerate(line)
            ]
            for row, line in enumerate(self.taxels)
        ]

    def decays(self, row: int) -> bool:
        """Return True if the current sample tick is a decay tick of a row."""
        number, period = self.ticks - 1, self.config.leak_period
        return self.tick and number % period == row * period // self.config.rows

    def clock(
        self,
        sample: Sequence[int] | None,
        enable: Sequence[bool],
        ready: bool,
        decisions: Sequence[tuple[bool, bool]] | None = None,
    ) -> None:
        """Apply a rising edge with the inputs of all taxels, rows * columns long.

        ``sample`` has codes if ``sample_valid`` is high. ``ready`` is ``event_ready``; a four-phase link has its own.
        ``decisions`` are those of the comparators, above and below, if the signal does not determine them.
        """
        sample = None if sample is None else self.seen(sample)
        enable = [on and bool(field.taxels) for on, field in zip(enable, self.fields, strict=True)]
        four_phase = self.config.handshake
        if four_phase:
            ready = self.link.ready
        requests = self.requests(enable)
        event = self.arbiter.event
        granted = self.arbiter.granted(requests, ready)
        if event is not None and ready:
            self.accepted.append(TimedEvent(self.time, *event))

        for row, line in enumerate(self.taxels):
            for column, taxel in enumerate(line):
                index = row * self.config.columns + column
                waited = taxel.pending and row != granted
                x = self.signal[row][column]
                digital = self.config.frontend == "digital"
                taxel.clock(
                    enable=enable[index],
                    tick=self.tick,
                    granted=row == granted,
                    decay=self.decays(row),
                    sample=sample[index] if digital and sample is not None else None,
                    decision=None if digital else taxel.comparators(x) if decisions is None else decisions[index],
                )
                if taxel.pending and not waited:
                    polarity = taxel.polarity if self.config.has_polarity else True
                    self.raised.append(TimedEvent(self.time + 1, row, column, polarity))
                if sample is not None:
                    self.signal[row][column] = sample[index]
        self.arbiter.clock(requests, ready)
        if four_phase:
            self.link.clock(event, self.receiver.ack_at(self.time))
            self.receiver.see(self.link.req, self.time)
        self.tick = sample is not None
        self.ticks += self.tick
        self.time += 1


def play(
    config: ReadoutConfig, stimulus: Stimulus, clocks: int | None = None
) -> tuple[ReadoutReference, list[TimedEvent]]:
    """Play a stimulus; return the final state of the readout and its events.

    An event's clock is the clock of its transfer (stream), or the clock whose edge raises REQ (four-phase); REQ is
    visible in the next clock.
    """
    readout = ReadoutReference(config, stimulus.ack_delay.tolist())
    samples: dict[int, list[int]] = dict(zip(stimulus.sample_clock.tolist(), stimulus.samples.tolist(), strict=True))
    masks: dict[int, list[bool]] = dict(zip(stimulus.enable_clock.tolist(), stimulus.enable.tolist(), strict=True))
    ready = stimulus.ready.tolist()
    events: list[TimedEvent] = []
    req, enable = False, masks[0]
    for clock in range(stimulus.clocks if clocks is None else clocks):
        if readout.link.req and not req:
            assert readout.link.address is not None
            events.append(TimedEvent(clock - 1, *readout.link.address))
        req = readout.link.req
        enable = masks.get(clock, enable)
        decisions = None
        if stimulus.decisions is not None:
            found = stimulus.decisions[clock].tolist()
            decisions = [(bits & 1 != 0, config.has_polarity and bits & 2 != 0) for bits in found]
        readout.clock(samples.get(clock), enable, bool(ready[clock % len(ready)]), decisions)
    return readout, events if config.handshake else readout.accepted
