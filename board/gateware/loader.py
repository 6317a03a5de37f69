"""Executor of host frames: load samples, run the chip, load weights, answer queries."""

from typing import Any

from amaranth.hdl import Cat, Const, Module, Mux, Signal, Value
from amaranth.lib.wiring import Component, In, Out

from eskin.board.changes import JUMP_BITS, unread_bits
from eskin.board.config import BoardConfig
from eskin.board.records import hello_values
from eskin.board.serial_frames import Kind
from eskin.rtl.classifier.core import Classifier

RUN_BITS = 32  # bytes of the number of clocks in a RUN
SCANS_BITS = 16  # bytes of the number of scans in a SENSE


class Loader(Component):
    """Frame executor; the chip runs only for the requested number of clocks.

    A sample that comes is shifted in behind those of the taxels before: when that of the last is there, the chip gets a
    sample tick and the clocks of a sample. Frames are carried out in their order, and acknowledged then.

    A frame of changes is read bit by bit. The code of the next taxel leaves the shift register at its end, and comes in
    again, changed or not, at its beginning.
    """

    def __init__(self, config: BoardConfig) -> None:
        self.config = config
        ports: dict[str, Any] = {
            "valid": In(1),  # a byte of ``FrameReceiver``
            "ready": Out(1),
            "data": In(8),
            "run": In(1),  # the chip is clocked
            "active": Out(1),  # the chip has clocks left
            "restart": Out(1),  # the chip is reset
            "ack_sequence": Out(8),
        }
        for name in ("ack", "unknown", "status"):  # to ``Recorder``; the kind or the length of ``unknown`` is wrong
            ports |= {f"{name}_valid": Out(1), f"{name}_ready": In(1)}
        if config.chip:
            self.readout = readout = config.chip.readout
            own = Classifier(config.chip.classifier).signature.members
            ports |= {"sample": Out(readout.taxels * readout.sample_bits), "sample_valid": Out(1)}
            ports |= {"short": Out(1)}  # the host takes short events
            if config.sensor:  # a scan of the skin may begin; a sample of its next taxel
                ports |= {"sensing": Out(1), "taxel_valid": In(1), "taxel": In(readout.sample_bits)}
            ports |= {name: Out(own[name].shape) for name in own if name.startswith("load_")}  # while it is reset
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
            self.ticks = Signal(8)  # of a frame of changes
            self.changes = Signal()
            self.scans = Signal(SCANS_BITS)
            self.count = Signal(range(self.readout.taxels))  # number of taxels with a sample
            with m.If(self.run):
                m.d.sync += self.sample_valid.eq(0)
            self.falling = Signal(self.readout.taxels)  # whether the last step of a taxel was a fall
            with m.If(self.restart):
                m.d.sync += [self.count.eq(0), self.sample.eq(0), self.falling.eq(0)]
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
            come = (kind == Kind.SAMPLES) | (kind == Kind.CHANGES) | (kind == Kind.SENSE)  # while the chip runs
            with m.State("CHOOSE"), m.If(~self.active | come):
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
                self._option(m, taken, left)
                self._samples(m, taken, left, budget)
                self._changes(m, taken, left)
                if self.config.sensor:
                    self._sense(m, taken, left)
                self._run(m, taken, left, budget)
                self._weights(m, taken, left)
        return m

    def _choose(self, m: Module, kind: Signal, left: Signal) -> None:
        """Dispatch a frame; most kinds of frames wait until the chip has stopped."""
        m.next = "SKIP"
        if self.config.chip:
            with m.If(kind == Kind.RESTART):
                m.d.sync += self.short.eq(0)
        cases: list[tuple[Kind, Value, str]] = [(Kind.STATUS, left == 0, "STATUS")]
        if not self.config.chip:
            cases += [(Kind.RESTART, left == 0, "RESTART")]
        else:
            cases += [
                (Kind.RESTART, left <= 1, "OPTION"),
                (Kind.CHANGES, left > 1, "TICKS"),
                *([(Kind.SENSE, left == SCANS_BITS // 8, "SCANS")] if self.config.sensor else []),
                (Kind.SAMPLES, (left != 0) & ~left[0], "LOW"),
                (Kind.RUN, left == RUN_BITS // 8, "RUN"),
                (Kind.WEIGHTS, left > 3, "NEURONS"),
            ]
        for number, fits, state in cases:
            with m.If((kind == number) & fits):
                m.next = state

    def _samples(self, m: Module, taken: Signal, left: Signal, budget: Signal) -> None:
        """Add the states that shift samples in."""
        readout = self.readout
        low = Signal(8)
        with m.State("LOW"):
            m.d.comb += self.ready.eq(1)
            with m.If(taken):
                m.d.sync += low.eq(self.data)
                m.next = "HIGH"
        with m.State("HIGH"):
            m.d.comb += self.ready.eq(~self.sample_valid)  # wait until the chip has taken the sample
            with m.If(taken):
                self._shift(m, Cat(low, self.data)[: readout.sample_bits], self.falling[0], "NEXT")
        with m.State("TICK"), m.If(~self.active):
            m.d.sync += [self.sample_valid.eq(1), self.active.eq(1), budget.eq(readout.clocks_per_sample)]
            m.next = "NEXT"
        with m.State("NEXT"):
            m.next = "LOW"
            with m.If(self.changes):
                m.d.sync += self.ticks.eq(self.ticks - 1)
                m.next = "BITS"
                with m.If(self.ticks == 1):
                    m.next = "DONE"
            if self.config.sensor:
                with m.Elif(self.scans != 0):
                    m.d.sync += self.scans.eq(self.scans - 1)
                    m.next = "SENSE"
                    with m.If(self.scans == 1):
                        m.next = "ACK"
            with m.Elif(left == 0):
                m.next = "ACK"

    def _sense(self, m: Module, taken: Signal, left: Signal) -> None:
        """Add the states that take the samples of a number of scans from the skin."""
        with m.State("SCANS"):
            m.d.comb += self.ready.eq(left != 0)
            with m.If(taken):
                m.d.sync += self.scans.eq(Cat(self.scans[8:], self.data))
            with m.If(left == 0):
                m.next = "SENSE"
                with m.If(self.scans == 0):
                    m.next = "ACK"
        with m.State("SENSE"):
            m.d.comb += self.sensing.eq(~self.sample_valid)
            with m.If(self.taxel_valid):
                self._shift(m, self.taxel, self.falling[0], "SENSE")

    def _shift(self, m: Module, code: Value, falling: Value, following: str) -> None:
        """Shift in the sample of a taxel; after the last taxel, give a sample tick."""
        readout, count = self.readout, self.count
        m.d.sync += [
            self.sample.eq(Cat(self.sample, code)[readout.sample_bits :]),
            self.falling.eq(Cat(self.falling, falling)[1:]),
            count.eq(count + 1),
        ]
        m.next = following
        with m.If(count == readout.taxels - 1):
            m.d.sync += count.eq(0)
            m.next = "TICK"

    def _option(self, m: Module, taken: Signal, left: Signal) -> None:
        """Add the state that reads whether a restart permits short events."""
        with m.State("OPTION"):
            m.d.comb += self.ready.eq(left != 0)
            with m.If(taken):
                m.d.sync += self.short.eq(self.data[0])
            with m.If(left == 0):
                m.next = "RESTART"

    def _changes(self, m: Module, taken: Signal, left: Signal) -> None:
        """Add the states that read the changes of each tick (docs/reference/board.md).

        A taxel has up to three bits. Three ones are followed by a whole code.
        """
        readout = self.readout
        low = unread_bits(readout)
        width = readout.sample_bits - low
        bits, valid = Signal(8), Signal(range(9))  # rest of the last byte, and its number of bits
        ones, code, had = Signal(range(JUMP_BITS)), Signal(width), Signal(range(width + 1))
        bit = bits[0]
        old, falling = self.sample[low : readout.sample_bits], self.falling[0]
        down = Mux(ones == 2, ~falling, falling)
        stepped = (old + Mux(down, -1, 1))[:width]
        with m.State("TICKS"):
            m.d.comb += self.ready.eq(1)
            with m.If(taken):
                m.d.sync += [self.ticks.eq(self.data), self.changes.eq(self.data != 0), valid.eq(0), ones.eq(0)]
                m.next = "BITS"
                with m.If(self.data == 0):
                    m.next = "SKIP"
        for name in ("BITS", "CODE"):
            with m.State(name):
                with m.If(valid == 0):
                    m.d.comb += self.ready.eq(left != 0)
                    with m.If(taken):
                        m.d.sync += [bits.eq(self.data), valid.eq(8)]
                    with m.If(left == 0):  # the frame ends in the middle of a tick
                        m.d.sync += self.changes.eq(0)
                        m.next = "UNKNOWN"
                with m.Elif(~self.sample_valid):  # wait until the chip has taken the sample
                    m.d.sync += [bits.eq(bits[1:]), valid.eq(valid - 1)]
                    if name == "CODE":
                        m.d.sync += [code.eq(Cat(code[1:], bit)), had.eq(had + 1)]
                        with m.If(had == width - 1):
                            self._shift(m, Cat(Const(0, low), code[1:], bit), falling, "BITS")
                    else:
                        m.d.sync += [ones.eq(ones + 1), had.eq(0)]
                        with m.If(~bit):
                            m.d.sync += ones.eq(0)
                            with m.If(ones == 0):
                                self._shift(m, self.sample[: readout.sample_bits], falling, "BITS")
                            with m.Else():
                                self._shift(m, Cat(Const(0, low), stepped), down, "BITS")
                        with m.Elif(ones == JUMP_BITS - 1):
                            m.d.sync += ones.eq(0)
                            m.next = "CODE"
        with m.State("DONE"):
            m.d.sync += self.changes.eq(0)
            m.next = "ACK"
            with m.If(left != 0):
                m.next = "SKIP"

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
