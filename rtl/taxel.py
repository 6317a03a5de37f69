"""The taxel: comparator, reference and one pending request, for the three encoders."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from amaranth.hdl import Cat, Const, Module, Mux, Signal, signed, unsigned
from amaranth.lib.wiring import In, Out

from model.config import ReadoutConfig
from rtl.block import Block
from rtl.logic import or_tree
from rtl.window import ClosingWindow


@dataclass(frozen=True)
class Own:
    """Signals that the parts of a taxel share.

    Attributes
    ----------
    pending : Signal
        Register: a request waits.
    enabled : Signal
        Register: the mask of the clock before, so that a masked taxel is reset once and then stands still; where the
        taxel ``sleeps``, it also has taken a sample since.
    on, off : Signal
        A free taxel steps up, or down, in this clock; where both are high, up.
    asks : Signal
        An enabled taxel, if it is free, raises a request in this clock.
    moves : Signal
        Enable of request, polarity and reference.
    closing : Signal
        The window may close in this clock.
    """

    pending: Signal
    enabled: Signal
    on: Signal
    off: Signal
    asks: Signal
    moves: Signal
    closing: Signal


def settings(config: ReadoutConfig) -> dict[str, Any]:
    """Return what a host sets at run time, as ports of every taxel; nothing without registers."""
    if config.registers == "none":
        return {}
    ports = {"step": In(config.resolution)}
    if config.encoding == "nlcs":
        ports["leak_shift"] = In(config.leak_shift.bit_length())
    if config.closes:
        ports["window_period"] = In(config.window_period.bit_length())
    return ports


class Taxel(Block[ReadoutConfig]):
    """One taxel: decides against its reference, raises a request, moves the reference.

    A taxel is free while it has no request or its request is being taken; only a free one decides, so a request
    may follow the old one without a bubble. While its request waits everything in it holds still.

    Latency: sample at clock t, decision at t + 1, request visible at t + 2. Throughput: one event per clock.

    Attributes
    ----------
    enable : In(1)
        Low silences the taxel in this clock and holds it in its reset state from the next on.
    tick : In(1)
        Sample tick, the clock after ``sample_valid``; only where the taxel itself needs it.
    decay : In(1)
        Leak in this clock (N-LCS).
    sample, sample_valid : In(W), In(1)
        The newest code (digital front end).
    above, below : In(1)
        Decisions of the comparator macros (analog front end): x >= reference + h, x < reference - h, for N-LCS
        x >= reference + D + 1; ``below`` only with polarity.
    reference_code : Out(W)
        Signed, in sample codes, a register (analog front end).
    half_width : Out(half_width_bits)
        h in sample codes, a register (analog front end); absent where it is always D.
    step, leak_shift, window_period : In
        What a host sets (``registers="spi"``), if the encoder has it: D, one-hot in units of the D that was built, k,
        and the ticks of the window.
    granted : In(1)
        The request, if there is one, is taken in this clock.
    request, polarity : Out(1)
        The pending request and its polarity (1 is ON).
    stirs : Out(1)
        Some register may change at the end of this clock, even if the request is not taken, there is no new sample and
        no leak.
    """

    module_name = "eskin_taxel"

    def __init__(self, config: ReadoutConfig) -> None:
        digital, bipolar = config.frontend == "digital", config.has_polarity
        super().__init__(
            config,
            {
                "enable": In(1),
                "tick": In(1) if config.closes or config.decide_every == "sample" else None,
                "decay": In(1) if config.encoding == "nlcs" else None,
                "sample": In(signed(config.sample_bits)) if digital else None,
                "sample_valid": In(1) if digital else None,
                "above": None if digital else In(1),
                "below": None if digital or not bipolar else In(1),
                "reference_code": None if digital else Out(signed(config.sample_bits)),
                "half_width": None if digital or not config.closes else Out(config.half_width_bits),
                **settings(config),
                "granted": In(1),
                "request": Out(1),
                "polarity": Out(1) if bipolar else None,
                "stirs": Out(1),
            },
        )

    def elaborate(self, platform: Any) -> Module:
        # Everything is done in units of the encoder's grid (D for LCS, the closing step for CW-LCS, one code for
        # N-LCS): the reference stands on it, so lower bits of a sample cannot change a decision.
        # Few enables, so that few gates stop the clock: ``moves`` serves request, polarity and reference. Where it is
        # high an enabled taxel is free, so what they become does not wait for the grant.
        m = Module()
        config = self.config
        own = Own(*(Signal(name=field.name) for field in fields(Own)))
        above, below = self._leaky(m, own) if config.encoding == "nlcs" else self._level(m, own, platform)
        decide = self.tick if config.decide_every == "sample" else Const(1)
        switched = Signal()
        m.d.comb += switched.eq(self.enable ^ own.enabled)
        if self.sleeps:
            decide &= own.enabled
            m.d.comb += switched.eq(Mux(own.enabled, ~self.enable, self.enable & self.sample_valid))
        leaks = own.enabled & self.decay if config.encoding == "nlcs" else Const(0)
        m.d.comb += [
            self.request.eq(own.pending & self.enable),
            own.on.eq(decide & above),
            own.off.eq(decide & below),
            own.asks.eq(self.enable & (own.on | own.off)),
            own.moves.eq(switched | Mux(own.pending, self.granted, own.asks | leaks)),
            self.stirs.eq(switched | (~own.pending & own.asks) | own.closing),
        ]
        with m.If(own.moves):
            m.d.sync += [own.enabled.eq(self.enable), own.pending.eq(own.asks)]
        if config.has_polarity:
            sign = Signal()
            with m.If(own.moves):
                m.d.sync += sign.eq(own.on)
            m.d.comb += self.polarity.eq(sign)
        return m

    @property
    def sleeps(self) -> bool:
        """Whether the taxel does nothing from its reset to its first sample: then masks need not reset the sample.

        A reference of 0 meets a sample of 0, and no window closes.
        """
        config = self.config
        return config.frontend == "digital" and config.reference_reset == 0 and not config.closes

    def _leaky(self, m: Module, own: Own) -> tuple[Any, Any]:
        """Add the reference of N-LCS; return whether a step up is due, and one down, which never is."""
        config = self.config
        fraction, shift = config.fraction_bits, config.leak_shift
        charge = Signal(config.sample_bits - 1 + fraction, init=config.reference_reset << fraction)
        reference = Signal(config.sample_bits - 1)
        m.d.comb += reference.eq(charge[fraction:])
        step: Any = config.step
        # (u + 2**(k-1)) >> k without the adder: rounding up adds the highest bit that is shifted out.
        rounded = charge[shift:] + charge[shift - 1 : shift]
        fits = ~reference[config.step.bit_length() - 1 :].all()
        if config.registers != "none":
            step = self.step << (config.step - 1).bit_length()
            shifted = Cat(Const(0, 1), charge) >> self.leak_shift
            rounded = shifted[1:] + shifted[:1]
            fits = ~(reference | (step - 1)[: len(reference)]).all()
        rise = Mux(own.on, step << fraction, 0)
        share = Signal(len(rounded))
        m.d.comb += share.eq(rounded)
        leak = Mux(self.decay, share, 0)
        with m.If(own.moves):
            m.d.sync += charge.eq(Mux(self.enable, (charge + rise - leak)[: len(charge)], charge.init))
        above, below = self._compare(m, own, reference, step)
        return above & fits, below

    def _level(self, m: Module, own: Own, platform: Any) -> tuple[Any, Any]:
        """Add the reference of LCS and the window of CW-LCS; return whether a step up is due, and one down.

        A digital sample never asks for a step that would leave the scale (``model.taxel``).
        """
        config = self.config
        shape = signed(config.sample_bits - (config.grid - 1).bit_length())
        reference = Signal(shape, init=config.reference_reset // config.grid)
        half_width: Any = 1 if config.registers == "none" else self.step
        if config.closes:
            window = ClosingWindow(config)
            window.place(m, "window", platform)
            free = ~own.pending | self.granted
            m.d.comb += [
                window.open.eq((free & own.asks) | (own.enabled & ~self.enable)),
                window.tick.eq(free & self.enable & self.tick),
                own.closing.eq(self.tick & ~window.closed),
            ]
            half_width = window.half_width
            if config.registers != "none":
                m.d.comb += window.period.eq(self.window_period)
                half_width = or_tree(
                    [(half_width & on.replicate(len(half_width))) << s for s, on in enumerate(self.step)]
                )
        fall = Signal(signed(half_width.bit_length() + 1 if isinstance(half_width, int) else len(half_width) + 1))
        m.d.comb += fall.eq(-half_width)
        above, below = self._compare(m, own, reference, half_width)

        moved = Signal(signed(len(reference) + (config.frontend == "analog")))
        if config.frontend == "digital":
            turns: Any = own.moves
            step = Mux(own.on, half_width, Mux(own.off, fall, 0))
        else:
            # A step off the scale is not made. Where both fire, reference and polarity follow above.
            turns = own.moves & (own.asks | ~self.enable)
            step = Mux(self.above, half_width, fall)
            fits = Signal()
            m.d.comb += fits.eq(moved[-1] == moved[-2])
            above, below = above & fits, below & fits
        m.d.comb += moved.eq((reference + step)[: len(moved)])
        with m.If(turns):
            m.d.sync += reference.eq(Mux(self.enable, moved[: len(reference)], reference.init))
        return above, below

    def _compare(self, m: Module, own: Own, reference: Signal, half_width: Any) -> tuple[Any, Any]:
        """Add the sample and its comparators, or the reference of the analog ones; return what they say."""
        config = self.config
        low_bits = (config.grid - 1).bit_length()
        if config.frontend == "analog":
            m.d.comb += self.reference_code.eq(reference << low_bits)
            if config.closes:
                m.d.comb += self.half_width.eq(half_width << low_bits)
            return self.above, self.below if config.has_polarity else Const(0)

        sample = Signal(signed(config.sample_bits - low_bits), name="newest")
        newest: Any = self.sample[low_bits:].as_signed()
        if not config.has_polarity:  # a sample below zero never asks: it counts as zero
            sample = Signal(config.sample_bits - 1, name="newest")
            newest = Mux(self.sample[-1], 0, self.sample[:-1])
        takes = self.enable & self.sample_valid
        if not self.sleeps:
            takes |= ~self.enable & own.enabled
            newest = Mux(self.enable, newest, 0)
        with m.If(takes):
            m.d.sync += sample.eq(newest)
        difference = Signal(signed(len(sample) + 1))
        m.d.comb += difference.eq(sample - reference)
        above = Signal()
        if not config.has_polarity:
            m.d.comb += above.eq(difference > half_width)
            return above, Const(0)
        below = Signal()
        m.d.comb += [above.eq(difference >= half_width), below.eq(difference < -half_width)]
        return above, below


class Row(Block[ReadoutConfig]):
    """A row of taxels on its request line and the array's column lines.

    Attributes
    ----------
    enable, granted, select, request : In(columns), In(1), In(1), Out(1)
        Masks of the taxels; the row's requests are taken in this clock; the row drives the column lines; some
        taxel of the row requests.
    column_request, column_polarity : Out(columns)
        Requests and polarities of the row's taxels while it is selected, else 0.
    awake : Out(1)
        Low in a clock at whose end no register of the row changes: its clock may be stopped.
    tick, decay, sample, sample_valid, above, below, reference_code, half_width
        As those of ``Taxel``, column 0 in the least significant bits.
    """

    module_name = "eskin_row"

    def __init__(self, config: ReadoutConfig) -> None:
        columns = config.columns
        taxel = Taxel(config)
        shared = {"tick", "decay", "sample_valid", *settings(config)}
        own = {"enable", "granted", "request", "polarity", "stirs"}
        ports: dict[str, Any] = {
            "enable": In(columns),
            "select": In(1),
            "granted": In(1),
            "request": Out(1),
            "column_request": Out(columns),
            "column_polarity": Out(columns) if config.has_polarity else None,
            "awake": Out(1),
        }
        self.shared = [name for name in taxel.signature.members if name in shared]
        self.per_taxel = [name for name in taxel.signature.members if name not in shared | own]
        for name, member in taxel.signature.members.items():
            if name in shared:
                ports[name] = In(len(getattr(taxel, name)))
            elif name not in own:
                flow = In if member.flow is In else Out
                ports[name] = flow(unsigned(columns * len(getattr(taxel, name))))
        super().__init__(config, ports)

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        requests, polarities = [], []
        stirs: list[Any] = [
            self.granted,
            *(getattr(self, name) for name in ("sample_valid", "decay") if name in self.shared),
        ]
        for column in range(self.config.columns):
            taxel = Taxel(self.config)
            taxel.place(m, f"taxel_{column}", platform)
            m.d.comb += [taxel.enable.eq(self.enable[column]), taxel.granted.eq(self.granted)]
            m.d.comb += [getattr(taxel, name).eq(getattr(self, name)) for name in self.shared]
            for name in self.per_taxel:
                width = len(getattr(taxel, name))
                taxel.connect(m, name, getattr(self, name)[column * width : (column + 1) * width])
            requests.append(taxel.request)
            stirs.append(taxel.stirs)
            if self.config.has_polarity:
                polarities.append(taxel.polarity)
        request = Cat(requests)
        m.d.comb += [
            self.request.eq(request.any()),
            self.awake.eq(or_tree(stirs)),
            self.column_request.eq(request & self.select.replicate(len(requests))),
        ]
        if polarities:
            m.d.comb += self.column_polarity.eq(Cat(polarities) & self.select.replicate(len(polarities)))
        return m
