"""The taxel: comparator, reference and one pending request, for the three encoders."""

from __future__ import annotations

from typing import Any

from amaranth.hdl import Cat, Module, Mux, Signal, signed, unsigned
from amaranth.lib.wiring import In, Out

from model.config import ReadoutConfig
from rtl.block import Block
from rtl.window import ClosingWindow


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
    granted : In(1)
        The request, if there is one, is taken in this clock.
    request, polarity : Out(1)
        The pending request and its polarity (1 is ON).
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
                "granted": In(1),
                "request": Out(1),
                "polarity": Out(1) if bipolar else None,
            },
        )

    def elaborate(self, platform: Any) -> Module:
        # Everything is done in units of the encoder's grid (D for LCS, the closing step for CW-LCS, one code for
        # N-LCS): the reference stands on it, so lower bits of a sample cannot change a decision.
        m = Module()
        config = self.config
        pending = Signal()
        free = Signal()
        decide = Signal()
        on = Signal()
        off = Signal()
        m.d.comb += [
            self.request.eq(pending & self.enable),
            free.eq(~pending | self.granted),
            decide.eq(free & self.tick if config.decide_every == "sample" else free),
        ]

        reference = self._reference(m, free, on, off, platform)
        above, below = self._compare(m, *reference)
        m.d.comb += on.eq(decide & above)
        if config.has_polarity:
            m.d.comb += off.eq(decide & below)

        with m.If(~self.enable):
            m.d.sync += pending.eq(0)
        with m.Elif(free):
            m.d.sync += pending.eq(on | off)
        if config.has_polarity:
            sign = Signal()
            with m.If(~self.enable):
                m.d.sync += sign.eq(0)
            with m.Elif(decide):
                m.d.sync += sign.eq(above)
            m.d.comb += self.polarity.eq(sign)
        return m

    def _reference(self, m: Module, free: Signal, on: Signal, off: Signal, platform: Any) -> tuple[Signal, Any, Any]:
        """Add the reference register; return it, the half-width of the window, and whether a step stays on the scale.

        Both are in grid units. A digital sample never asks for a step that would leave the scale (``model.taxel``).
        """
        config = self.config
        init = config.reference_reset // config.grid
        if config.encoding == "nlcs":
            fraction, shift = config.fraction_bits, config.leak_shift
            init <<= fraction
            charge = Signal(config.sample_bits - 1 + fraction, init=init)
            rise = Mux(on, config.step << fraction, 0)
            # (u + 2**(k-1)) >> k without the adder: rounding up adds the highest bit that is shifted out.
            leak = charge[shift:] + charge[shift - 1 : shift]
            with m.If(~self.enable):
                m.d.sync += charge.eq(init)
            with m.Elif(free & self.decay):
                m.d.sync += charge.eq((charge + rise - leak)[: len(charge)])
            with m.Elif(on):
                m.d.sync += charge.eq((charge + rise)[: len(charge)])
            reference = Signal(config.sample_bits - 1)
            m.d.comb += reference.eq(charge[fraction:])
            return reference, config.step, ~reference[config.step.bit_length() - 1 :].all()

        half_width: Any = 1
        if config.closes:
            window = ClosingWindow(config)
            window.place(m, "window", platform)
            m.d.comb += [
                window.enable.eq(self.enable),
                window.free.eq(free),
                window.tick.eq(self.tick),
                window.fired.eq(on | off),
            ]
            half_width = window.half_width
        reference = Signal(signed(config.sample_bits - (config.grid - 1).bit_length()), init=init)
        with m.If(~self.enable):
            m.d.sync += reference.eq(init)
        moved = reference + Mux(on if config.frontend == "digital" else self.above, half_width, -half_width)
        with m.Elif(on | off):
            m.d.sync += reference.eq(moved[: len(reference)])
        return reference, half_width, moved[len(reference)] == moved[len(reference) - 1]

    def _compare(self, m: Module, reference: Signal, half_width: Any, fits: Any) -> tuple[Any, Any]:
        """Add the comparators, or the reference of the analog ones; return whether to step up, and down."""
        config = self.config
        low_bits = (config.grid - 1).bit_length()
        if config.frontend == "analog":
            m.d.comb += self.reference_code.eq(reference << low_bits)
            if config.closes:
                m.d.comb += self.half_width.eq(half_width << low_bits)
            # Where both fire, reference and polarity follow above.
            return self.above & fits, self.below & fits if config.has_polarity else None

        sample = Signal(signed(config.sample_bits - low_bits))
        with m.If(~self.enable):
            m.d.sync += sample.eq(0)
        with m.Elif(self.sample_valid):
            m.d.sync += sample.eq(self.sample[low_bits:].as_signed())
        difference = Signal(signed(config.sample_bits - low_bits + 1))
        m.d.comb += difference.eq(sample - reference)
        above = Signal()
        if not config.has_polarity:
            m.d.comb += above.eq(difference > half_width)
            return above, None
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
    tick, decay, sample, sample_valid, above, below, reference_code, half_width
        As those of ``Taxel``, column 0 in the least significant bits.
    """

    module_name = "eskin_row"

    def __init__(self, config: ReadoutConfig) -> None:
        columns = config.columns
        taxel = Taxel(config)
        shared = {"tick", "decay", "sample_valid"}
        own = {"enable", "granted", "request", "polarity"}
        ports: dict[str, Any] = {
            "enable": In(columns),
            "select": In(1),
            "granted": In(1),
            "request": Out(1),
            "column_request": Out(columns),
            "column_polarity": Out(columns) if config.has_polarity else None,
        }
        self.shared = [name for name in taxel.signature.members if name in shared]
        self.per_taxel = [name for name in taxel.signature.members if name not in shared | own]
        for name, member in taxel.signature.members.items():
            if name in shared:
                ports[name] = In(1)
            elif name not in own:
                flow = In if member.flow is In else Out
                ports[name] = flow(unsigned(columns * len(getattr(taxel, name))))
        super().__init__(config, ports)

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        requests, polarities = [], []
        for column in range(self.config.columns):
            taxel = Taxel(self.config)
            taxel.place(m, f"taxel_{column}", platform)
            m.d.comb += [taxel.enable.eq(self.enable[column]), taxel.granted.eq(self.granted)]
            m.d.comb += [getattr(taxel, name).eq(getattr(self, name)) for name in self.shared]
            for name in self.per_taxel:
                width = len(getattr(taxel, name))
                taxel.connect(m, name, getattr(self, name)[column * width : (column + 1) * width])
            requests.append(taxel.request)
            if self.config.has_polarity:
                polarities.append(taxel.polarity)
        request = Cat(requests)
        m.d.comb += [
            self.request.eq(request.any()),
            self.column_request.eq(request & self.select.replicate(len(requests))),
        ]
        if polarities:
            m.d.comb += self.column_polarity.eq(Cat(polarities) & self.select.replicate(len(polarities)))
        return m
