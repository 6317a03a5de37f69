"""Executor of host frames: load samples, run the chip, load weights, answer queries."""

from __future__ import annotations

from typing import Any

from amaranth.hdl import Cat, Module, Signal
from amaranth.lib.wiring import Component, In, Out

from eskin.board.config import BoardConfig
from eskin.board.records import hello_values
from eskin.board.serial_frames import Kind
from eskin.rtl.classifier.core import Classifier

RUN_BITS = 32
"""Of the clocks that a RUN gives."""


class Loader(Component):
    """Frame executor; the chip runs only for the requested number of clocks.

    A sample that comes is shifted in behind those of the taxels before: when that of the last is there, the chip gets a
    sample tick and the clocks of a sample. Frames are carried out in their order, and acknowledged then.

    Attributes
    ----------
    valid, ready, data : In, Out, In
        From ``FrameReceiver``.
    run : In(1)
        The chip is clocked.
    active : Out(1)
        It has clocks left.
    restart : Out(1)
        It is reset.
    sample, sample_valid : Out
        Of the chip (player).
    load_valid, load_neurons, load_address, load_data : Out
        Of the classifier, while it is reset (player).
    ack_valid, ack_sequence, ack_ready, unknown_valid, unknown_ready, status_valid, status_ready : Out, Out, In
        To ``Recorder``; ``unknown`` is a frame that is none of these, or of a wrong length.
    """

    def __init__(self, config: BoardConfig) -> None:
        self.config = config
        ports: dict[str, Any] = {
            "valid": In(1),
            "ready": Out(1),
            "data": In(8),
            "run": In(1),
            "active": Out(1),
            "restart": Out(1),
            "ack_sequence": Out(8),
        }
        for name in ("ack", "unknown", "status"):
            ports |= {f"{name}_valid": Out(1), f"{name}_ready": In(1)}
        if config.chip:
            readout, own = config.chip.readout, Classifier(config.chip.classifier).signature.members
            ports |= {"sample": Out(readout.taxels * readout.sample_bits), "sample_valid": Out(1)}
            ports |= {name: Out(own[name].shape) for name in own if name.startswith("load_")}
        super().__init__(ports)

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        kind, left, taken = Signal(8), Signal(8), Signal()
        budget = Signal(RUN_BITS)
        m.d.comb += taken.eq(self.valid & self.ready)
        with m.If(self.run):
            m.d.sync += [budget.eq(budget - 1), self.active.eq(budget != 1)]
        with m.If(taken):
            m.d.sync += left.eq(left - 1)
        if self.config.chip:
            self.count = Signal(range(self.config.chip.readout.taxels))  # taxels whose sample is there
            with m.If(self.run):
                m.d.sync += self.sample_valid.eq(0)
            with m.If(self.restart):
                m.d.sync += self.count.eq(0)
        with m.FSM():
            for name, field, following in (
                ("KIND", kind, "SEQUENCE"),
                ("SEQUENCE", self.ack_sequence, "LENGTH"),
                ("LENGTH", left, "CHOOSE"),
            ):
                with m.State(name):
                    m.d.comb += self.ready.eq(1)
                    with m.If(taken):
                        m.d.sync += field.eq(self.data)
                        m.next = following
            with m.State("CHOOSE"), m.If(~self.active | (kind == Kind.SAMPLES)):
                self._choose(m, kind, left)
            with m.State("RESTART"):
                m.d.comb += self.restart.eq(1)
                m.next = "ACK"
            with m.State("STATUS"):
                m.d.comb += self.status_valid.eq(1)
                with m.If(self.status_ready):
                    m.next = "ACK"
            with m.State("SKIP"):
                m.d.comb += self.ready.eq(left != 0)
                with m.If(left == 0):
                    m.next = "UNKNOWN"
            with m.State("UNKNOWN"):
                m.d.comb += self.unknown_valid.eq(1)
                with m.If(self.unknown_ready):
                    m.next = "KIND"
            with m.State("ACK"):
                m.d.comb += self.ack_valid.eq(1)
                with m.If(self.ack_ready):
                    m.next = "KIND"
            if self.config.chip:
                self._samples(m, taken, left, budget)
                self._run(m, taken, left, budget)
                self._weights(m, taken, left)
        return m

    def _choose(self, m: Module, kind: Signal, left: Signal) -> None:
        """Dispatch a frame; most kinds of frames wait until the chip has stopped."""
        m.next = "SKIP"
        cases = [(Kind.RESTART, left == 0, "RESTART"), (Kind.STATUS, left == 0, "STATUS")]
        if self.config.chip:
            cases += [
                (Kind.SAMPLES, (left != 0) & ~left[0], "LOW"),
                (Kind.RUN, left == RUN_BITS // 8, "RUN"),
                (Kind.WEIGHTS, left > 3, "NEURONS"),
            ]
        for number, fits, state in cases:
            with m.If((kind == number) & fits):
                m.next = state

    def _samples(self, m: Module, taken: Signal, left: Signal, budget: Signal) -> None:
        """Add the states that shift samples in."""
        assert self.config.chip is not None
        readout = self.config.chip.readout
        low, count = Signal(8), self.count
        with m.State("LOW"):
            m.d.comb += self.ready.eq(1)
            with m.If(taken):
                m.d.sync += low.eq(self.data)
                m.next = "HIGH"
        with m.State("HIGH"):
            m.d.comb += self.ready.eq(~self.sample_valid)  # which the chip has not yet taken
            with m.If(taken):
                code = Cat(low, self.data)[: readout.sample_bits]
                m.d.sync += [self.sample.eq(Cat(self.sample, code)[readout.sample_bits :]), count.eq(count + 1)]
                m.next = "NEXT"
                with m.If(count == readout.taxels - 1):
                    m.d.sync += count.eq(0)
                    m.next = "TICK"
        with m.State("TICK"), m.If(~self.active):
            m.d.sync += [self.sample_valid.eq(1), self.active.eq(1), budget.eq(readout.clocks_per_sample)]
            m.next = "NEXT"
        with m.State("NEXT"):
            m.next = "LOW"
            with m.If(left == 0):
                m.next = "ACK"

    def _run(self, m: Module, taken: Signal, left: Signal, budget: Signal) -> None:
        """Add the states that run the chip without new samples."""
        clocks = Signal(RUN_BITS)
        with m.State("RUN"):
            m.d.comb += self.ready.eq(left != 0)
            with m.If(taken):
                m.d.sync += clocks.eq(Cat(clocks[8:], self.data))
            with m.If(left == 0):
                m.d.sync += [budget.eq(clocks), self.active.eq(clocks != 0)]
                m.next = "WAIT"
        with m.State("WAIT"), m.If(~self.active):
            m.next = "ACK"

    def _weights(self, m: Module, taken: Signal, left: Signal) -> None:
        """Add the states that write words of weights to consecutive addresses."""
        address = Signal(16)
        word_bytes = hello_values(self.config)["word_bytes"]
        word, count = Signal(8 * word_bytes), Signal(range(word_bytes))
        m.d.comb += [self.load_address.eq(address), self.load_data.eq(word)]
        for name, following in (("NEURONS", "ADDRESS_LOW"), ("ADDRESS_LOW", "ADDRESS_HIGH"), ("ADDRESS_HIGH", "WORD")):
            with m.State(name):
                m.d.comb += self.ready.eq(1)
                with m.If(taken):
                    m.next = following
                    if name == "NEURONS":
                        m.d.sync += [self.load_neurons.eq(self.data[0]), count.eq(0)]
                    else:
                        m.d.sync += address.eq(Cat(address[8:], self.data))
        with m.State("WORD"):
            m.d.comb += self.ready.eq(left != 0)
            with m.If(left == 0):
                m.next = "ACK"
                with m.If(count != 0):
                    m.next = "UNKNOWN"
            with m.If(taken):
                m.d.sync += [word.eq(Cat(word[8:], self.data)), count.eq(count + 1)]
                with m.If(count == word_bytes - 1):
                    m.d.sync += count.eq(0)
                    m.next = "WRITE"
        with m.State("WRITE"):
            m.d.comb += [self.restart.eq(1), self.load_valid.eq(1)]
            m.d.sync += address.eq(address + 1)
            m.next = "WORD"
