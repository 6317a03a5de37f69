"""Frame receiver and sender in hardware; only frames with a correct CRC are accepted (board/serial_frames.py)."""

from typing import Any

from amaranth.hdl import Cat, Const, Module, Mux, Signal, Value
from amaranth.lib.crc.catalog import CRC32_ISO_HDLC
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import Component, In, Out

from eskin.board.config import SerialConfig
from eskin.board.records import Reason
from eskin.board.serial_frames import CRC_BYTES, ESCAPE, FLAG, FLIP, HEAD_BYTES, MAX_PAYLOAD, Kind

MAX_BODY = HEAD_BYTES + MAX_PAYLOAD + CRC_BYTES
WORDS_IN_A_FRAME = MAX_PAYLOAD // 4


class FrameReceiver(Component):
    """Receiver that buffers a frame, and forwards it if CRC, length and sequence number are correct.

    The bytes of a frame are written behind those that wait; only its end moves the mark up to which they may be read.
    The bytes of a rejected frame are overwritten.
    """

    _MustUse__silence = True  # some users read the ports without elaboration

    def __init__(self, config: SerialConfig) -> None:
        self.config = config
        super().__init__(
            {
                "byte_valid": In(1),
                "byte": In(8),
                "valid": Out(1),
                "ready": In(1),
                "data": Out(8),  # kind, sequence number, length and payload of good frames, one after the other
                "session": Out(1),  # for one clock after a good ``HELLO``, which empties the buffer
                "refused": Out(1),  # for one clock with each frame that is not taken
                "refused_sequence": Out(8),
                "refused_expected": Out(8),
                "refused_reason": Out(4),
                "taken": Out(1),  # for one clock with each frame that is taken
            }
        )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        depth = self.config.buffer_bytes
        m.submodules.crc = crc = CRC32_ISO_HDLC().create()
        m.submodules.memory = memory = Memory(shape=8, depth=depth, init=[])
        write, read = memory.write_port(), memory.read_port()
        pointer = range(2 * depth)  # one bit wider than the address, so that full and empty differ
        self.at, self.good, self.read_at = Signal(pointer), Signal(pointer), Signal(pointer)
        self.is_open, self.escaped, self.overrun = Signal(), Signal(), Signal()
        self.count = Signal(range(MAX_BODY + 2))
        self.kind, self.sequence, self.length, self.expected = Signal(8), Signal(8), Signal(8), Signal(8)
        plain, ends, full = Signal(), Signal(), Signal()
        byte = Mux(self.escaped, self.byte ^ FLIP, self.byte)
        m.d.comb += [
            plain.eq(self.byte_valid & self.is_open & (self.byte != FLAG) & ((self.byte != ESCAPE) | self.escaped)),
            ends.eq(self.byte_valid & (self.byte == FLAG)),
            full.eq((self.at - self.read_at)[: len(self.at)] == depth),
            write.addr.eq(self.at[:-1]),
            write.data.eq(byte),
            write.en.eq(plain & ~full),
            crc.data.eq(byte),
            crc.valid.eq(plain),
            crc.start.eq(ends),
        ]
        with m.If(self.byte_valid):
            m.d.sync += self.escaped.eq(self.is_open & (self.byte == ESCAPE) & ~self.escaped)
        with m.If(plain):
            m.d.sync += [
                self.at.eq(self.at + ~full),
                self.overrun.eq(self.overrun | full),
                self.count.eq(Mux(self.count > MAX_BODY, self.count, self.count + 1)),
            ]
            for number, field in enumerate((self.kind, self.sequence, self.length)):
                with m.If(self.count == number):
                    m.d.sync += field.eq(byte)
        self._end(m, ends, crc.match_detected)
        self._give(m, read)
        return m

    def _late(self, m: Module) -> Signal:
        """Return a signal that is high if the rest of a frame is overdue."""
        most = round(self.config.idle_bits * self.config.clocks_per_bit)
        idle, late = Signal(range(most)), Signal()
        m.d.comb += late.eq(idle == most - 1)
        m.d.sync += idle.eq(Mux(self.byte_valid | ~self.is_open | (self.count == 0), 0, idle + 1))
        return late

    def _end(self, m: Module, ends: Signal, right: Value) -> None:
        """Accept or reject the bytes between two flags, or an interrupted frame."""
        late, whole, hello = self._late(m), Signal(), Signal()
        m.d.comb += [
            whole.eq(right & ends & ~self.escaped & (self.count == self.length + (HEAD_BYTES + CRC_BYTES))),
            hello.eq(whole & (self.kind == Kind.HELLO)),
        ]
        m.d.sync += [self.taken.eq(0), self.refused.eq(0), self.session.eq(0)]
        with m.If(ends | late):
            m.d.sync += [self.is_open.eq(ends), self.count.eq(0), self.escaped.eq(0), self.overrun.eq(0)]
            m.d.sync += self.at.eq(self.good)
            with m.If(self.is_open & (self.count != 0)):
                with m.If(hello | (whole & ~self.overrun & (self.sequence == self.expected))):
                    m.d.sync += [self.taken.eq(1), self.session.eq(hello), self.expected.eq(self.sequence + 1)]
                    with m.If(~hello):
                        m.d.sync += [self.good.eq(self.at - CRC_BYTES), self.at.eq(self.at - CRC_BYTES)]
                with m.Else():
                    reason = Mux(whole, Reason.SEQUENCE, Reason.DAMAGED)
                    m.d.sync += [
                        self.refused.eq(1),
                        self.refused_sequence.eq(self.sequence),
                        self.refused_expected.eq(self.expected),
                        self.refused_reason.eq(Mux(self.overrun, Reason.OVERRUN, reason)),
                    ]

    def _give(self, m: Module, read: Any) -> None:
        """Forward the bytes of valid frames; a new session starts with an empty buffer."""
        m.d.comb += [read.addr.eq(self.read_at[:-1]), self.data.eq(read.data), read.en.eq(0)]
        with m.If((~self.valid | self.ready) & (self.read_at != self.good)):
            m.d.comb += read.en.eq(1)
            m.d.sync += [self.read_at.eq(self.read_at + 1), self.valid.eq(1)]
        with m.Elif(self.ready):
            m.d.sync += self.valid.eq(0)
        with m.If(self.session):
            m.d.sync += [self.read_at.eq(self.good), self.valid.eq(0)]


class FrameSender(Component):
    """Sender that packs waiting words into frames of records."""

    def __init__(self, config: SerialConfig) -> None:
        super().__init__(
            {
                "level": In(range(config.records + 1)),  # number of waiting words
                "word": In(32),  # the first of them
                "take": Out(1),
                "valid": Out(1),
                "ready": In(1),
                "byte": Out(8),
            }
        )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        m.submodules.crc = crc = CRC32_ISO_HDLC().create()
        sequence = Signal(8)
        words = Signal(range(WORDS_IN_A_FRAME + 1))
        place = Signal(2)
        byte, stuffed, done, escaped, marks = Signal(8), Signal(), Signal(), Signal(), Signal()
        m.d.comb += [
            stuffed.eq(~marks & ((byte == FLAG) | (byte == ESCAPE))),
            self.byte.eq(Mux(stuffed, Mux(escaped, byte ^ FLIP, ESCAPE), byte)),
            done.eq(self.valid & self.ready & (~stuffed | escaped)),
        ]
        with m.If(self.valid & self.ready):
            m.d.sync += escaped.eq(stuffed & ~escaped)
        m.d.comb += crc.data.eq(byte)
        with m.FSM() as machine:
            with m.State("REST"):
                m.d.comb += crc.start.eq(1)
                with m.If(self.level != 0):
                    m.d.sync += words.eq(Mux(self.level > WORDS_IN_A_FRAME, WORDS_IN_A_FRAME, self.level))
                    m.next = "OPEN"
            self._step(m, "OPEN", "KIND", FLAG, byte, done, marks)
            self._step(m, "KIND", "SEQUENCE", Kind.RECORDS, byte, done)
            self._step(m, "SEQUENCE", "LENGTH", sequence, byte, done)
            self._step(m, "LENGTH", "WORDS", Cat(Const(0, 2), words), byte, done)
            with m.State("WORDS"):
                m.d.comb += [self.valid.eq(1), byte.eq(self.word.word_select(place, 8))]
                with m.If(done):
                    m.d.sync += place.eq(place + 1)
                    with m.If(place == 3):
                        m.d.comb += self.take.eq(1)
                        m.d.sync += words.eq(words - 1)
                        with m.If(words == 1):
                            m.next = "CRC"
            with m.State("CRC"):
                m.d.comb += [self.valid.eq(1), byte.eq(crc.crc.word_select(place, 8))]
                with m.If(done):
                    m.d.sync += place.eq(place + 1)
                    with m.If(place == 3):
                        m.next = "CLOSE"
            with m.State("CLOSE"):
                m.d.comb += [self.valid.eq(1), marks.eq(1), byte.eq(FLAG)]
                with m.If(done):
                    m.d.sync += sequence.eq(sequence + 1)
                    m.next = "REST"
            body = Cat(machine.ongoing(name) for name in ("KIND", "SEQUENCE", "LENGTH", "WORDS")).any()
            m.d.comb += crc.valid.eq(done & body)
        return m

    def _step(
        self,
        m: Module,
        name: str,
        following: str,
        value: Value | int,
        byte: Signal,
        done: Signal,
        marks: Signal | None = None,
    ) -> None:
        """Add a state that sends one byte; ``marks`` is high for a flag byte."""
        with m.State(name):
            m.d.comb += [self.valid.eq(1), byte.eq(value)]
            if marks is not None:
                m.d.comb += marks.eq(1)
            with m.If(done):
                m.next = following
