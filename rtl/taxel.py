"""The taxel: encoder, comparators and one pending request."""

from dataclasses import fields
from typing import Any

from amaranth.hdl import Cat, Const, Module, Mux, Signal, signed, unsigned
from amaranth.lib.wiring import In, Out

from eskin.model.config import ReadoutConfig
from eskin.rtl.block import Block, numbered
from eskin.rtl.encoders.encoder import Shared
from eskin.rtl.encoders.registry import named
from eskin.rtl.logic import or_tree


def settings(config: ReadoutConfig) -> dict[str, Any]:
    """Return the settings of the host as taxel ports; empty without registers."""
    if config.registers == "none":
        return {}
    ports = {"step": In(config.resolution)}
    if config.encoder.leaks:
        ports["leak_shift"] = In(config.leak_shift.bit_length())
    if config.closes:
        ports["window_period"] = In(config.window_period.bit_length())
    return ports


class Taxel(Block[ReadoutConfig]):
    """One taxel: compares its sample with the thresholds, raises a request, and moves the reference.

    A taxel is free while it has no request, or while its request is taken. Only a free taxel decides, so requests may
    follow each other without a gap. While a request waits, no register of its taxel changes.

    Latency: sample at clock t, decision at t + 1, request visible at t + 2. Throughput: one event per clock.

    With the analog front end a taxel decides only while ``compare`` is high, so ``compare`` follows everything that may
    change an answer of the comparators. A request that waits asks again only while the answer is a step. The taxel
    therefore needs no register for the answer: if ``compare`` is low when the request is taken, the answer was no step.

    Attributes
    ----------
    enable : In(1)
        Low silences the taxel in this clock, and holds it in its reset state from the next clock on.
    tick : In(1)
        Sample tick, the clock after ``sample_valid``; absent if the taxel does not need it.
    ask : In(1)
        The comparators are asked in the next clock: a sample tick follows, or a host changed a threshold or a signal
        (analog front end).
    decay : In(1)
        The reference leaks in this clock; absent if the encoder does not leak.
    sample, sample_valid : In(W), In(1)
        The newest code (digital front end).
    above, below : In(1)
        Decisions of the comparator macros (analog front end): x >= reference + h, x < reference - h, for an
        encoder that is strict x >= reference + D + 1; ``below`` only with polarity. Ignored while ``compare`` is low.
    compare : Out(1)
        Strobe of the comparators, a register (analog front end): an answer in this clock may change the state.
    reference_code : Out(W)
        Signed, in sample codes, a register (analog front end).
    half_width : Out(half_width_bits)
        h in sample codes, a register (analog front end); absent if it is always D.
    step, leak_shift, window_period : In
        Settings of a host (``registers="spi"``) that the encoder has: D, one-hot in units of the built D; k; and the
        ticks of the window.
    granted : In(1)
        The request, if there is one, is taken in this clock.
    request, polarity : Out(1)
        The pending request and its polarity (1 is ON).
    needs_clock : Out(1)
        A register may change at the end of this clock, even without a grant, a new sample or a leak.
    """

    module_name = "eskin_taxel"

    def __init__(self, config: ReadoutConfig) -> None:
        digital, bipolar = config.lookup("frontend", digital=True, analog=False), config.has_polarity
        super().__init__(
            config,
            {
                "enable": In(1),
                "tick": In(1) if config.closes or (digital and config.decide_every == "sample") else None,
                "ask": None if digital else In(1),
                "decay": In(1) if config.encoder.leaks else None,
                "sample": In(signed(config.sample_bits)) if digital else None,
                "sample_valid": In(1) if digital else None,
                "above": None if digital else In(1),
                "below": None if digital or not bipolar else In(1),
                "compare": None if digital else Out(1),
                "reference_code": None if digital else Out(signed(config.sample_bits)),
                "half_width": None if digital or not config.closes else Out(config.half_width_bits),
                **settings(config),
                "granted": In(1),
                "request": Out(1),
                "polarity": Out(1) if bipolar else None,
                "needs_clock": Out(1),
            },
        )

    def elaborate(self, platform: Any) -> Module:
        # All numbers are in units of the encoder's grid: the reference is on the grid, so lower bits of a sample cannot
        # change a decision. Few enables need few clock gates: ``moves`` serves request, polarity and reference. While
        # ``moves`` is high an enabled taxel is free, so their new values do not depend on the grant.
        m = Module()
        config = self.config
        shared = Shared(*(Signal(name=field.metadata.get("wire", field.name)) for field in fields(Shared)))
        above, below = named(config.encoding)(m, self, shared, platform)
        analog = config.frontend == "analog"
        decide = self.compare if analog else self.tick if config.decide_every == "sample" else Const(1)
        switched = Signal()
        m.d.comb += switched.eq(self.enable ^ shared.enabled)
        if self.sleeps:
            decide &= shared.enabled
            m.d.comb += switched.eq(Mux(shared.enabled, ~self.enable, self.enable & self.sample_valid))
        leaks = shared.enabled & self.decay if config.encoder.leaks else Const(0)
        m.d.comb += [
            self.request.eq(shared.pending & self.enable),
            shared.on.eq(decide & above),
            shared.off.eq(decide & below),
            shared.wants_event.eq(self.enable & (shared.on | shared.off)),
            shared.moves.eq(switched | Mux(shared.pending, self.granted, shared.wants_event | leaks)),
        ]
        needs_clock: Any = ~shared.pending & shared.wants_event
        if analog:
            needs_clock = asked = Signal(name="asked")
            changes = (~shared.pending | self.granted) & (leaks | shared.narrows)
            asks = self.ask | (~shared.enabled | shared.on | shared.off | changes if config.asks_between_ticks else 0)
            m.d.sync += asked.eq(self.enable & asks)
            m.d.comb += self.compare.eq(asked)
        m.d.comb += self.needs_clock.eq(switched | needs_clock | shared.closing)
        with m.If(shared.moves):
            m.d.sync += [shared.enabled.eq(self.enable), shared.pending.eq(shared.wants_event)]
        if config.has_polarity:
            sign = Signal()
            with m.If(shared.moves):
                m.d.sync += sign.eq(shared.on)
            m.d.comb += self.polarity.eq(sign)
        return m

    @property
    def sleeps(self) -> bool:
        """True if the taxel is idle from reset to its first sample, so that masks need not reset the sample.

        A reference of 0 meets a sample of 0, and no window closes.
        """
        config = self.config
        return config.frontend == "digital" and config.reference_reset == 0 and not config.closes


class Row(Block[ReadoutConfig]):
    """A row of taxels with a common request line, connected to the column lines of the array.

    Attributes
    ----------
    enable, granted, select, request : In(columns), In(1), In(1), Out(1)
        Masks of the taxels; the row's requests are taken in this clock; the row drives the column lines; some
        taxel of the row requests.
    column_request, column_polarity : Out(columns)
        Requests and polarities of the row's taxels while it is selected, else 0.
    awake : Out(1)
        Low in a clock at whose end no register of the row changes: its clock may be stopped.
    tick, ask, decay, sample, sample_valid, above, below, compare, reference_code, half_width
        As those of ``Taxel``, column 0 in the least significant bits.
    """

    module_name = "eskin_row"

    def __init__(self, config: ReadoutConfig) -> None:
        columns = config.columns
        taxel = Taxel(config)
        shared = {"tick", "ask", "decay", "sample_valid", *settings(config)}
        own = {"enable", "granted", "request", "polarity", "needs_clock"}
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
        needs_clock: list[Any] = [
            self.granted,
            *(getattr(self, name) for name in ("sample_valid", "ask", "decay") if name in self.shared),
        ]
        for column in range(self.config.columns):
            taxel = Taxel(self.config)
            taxel.place(m, numbered("taxel", column, self.config.columns), platform)
            m.d.comb += [taxel.enable.eq(self.enable[column]), taxel.granted.eq(self.granted)]
            m.d.comb += [getattr(taxel, name).eq(getattr(self, name)) for name in self.shared]
            for name in self.per_taxel:
                taxel.connect(m, name, getattr(self, name).word_select(column, len(getattr(taxel, name))))
            requests.append(taxel.request)
            needs_clock.append(taxel.needs_clock)
            if self.config.has_polarity:
                polarities.append(taxel.polarity)
        request = Cat(requests)
        m.d.comb += [
            self.request.eq(request.any()),
            self.awake.eq(or_tree(needs_clock)),
            self.column_request.eq(request & self.select.replicate(len(requests))),
        ]
        if polarities:
            m.d.comb += self.column_polarity.eq(Cat(polarities) & self.select.replicate(len(polarities)))
        return m
