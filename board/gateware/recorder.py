"""Recorder that converts events of a board to words for the host (board/records.py)."""

from typing import Any

from amaranth.hdl import Array, Cat, Const, Module, Mux, Signal, Value
from amaranth.lib.fifo import SyncFIFOBuffered
from amaranth.lib.wiring import Component, In, Out

from eskin.board.config import ADDRESS_BITS, BoardConfig
from eskin.board.records import (
    COUNT_BITS,
    HELLO_WORDS,
    INTERVAL_BITS,
    PADDING,
    STATUS_WORDS,
    TIME_BITS,
    VALUE_BITS,
    WORD_BITS,
    Tag,
    additions,
    hello_values,
)

CLOCK_BITS = VALUE_BITS + TIME_BITS  # bits of the time: 4 days at 50 MHz
RESERVE = 32  # words for other records, which lossy events leave free


class Recorder(Component):
    """Recorder that writes one word per clock into the FIFO before the serial line.

    Short events are shifted, bit by bit, into a word of their own. Before any other record the rest of this word is
    filled with ones, which begin the code of an interval that is none. An event goes before other records.
    """

    def __init__(self, config: BoardConfig) -> None:
        self.config = config
        classifier = config.chip.classifier if config.chip else None
        self.classes = classifier.classes if classifier else 0
        self.evidence_bits = classifier.evidence_bits if classifier else 0
        self.address_bits = classifier.channel_bits if classifier else 0
        ports: dict[str, Any] = {
            "idle": Out(1),  # an event and a class may come in this clock
            "event_valid": In(1),
            "event_address": In(ADDRESS_BITS),
            "event_time": In(CLOCK_BITS),  # of the event and of the class
            "lost": In(VALUE_BITS),  # events lost since the last report
            "lost_told": Out(1),  # they are reported now
            "refused_word": In(VALUE_BITS),
            "ack_sequence": In(8),
            "status_words": In(WORD_BITS * len(STATUS_WORDS)),
            "level": Out(range(config.serial.records + 1)),  # to ``FrameSender``
            "word": Out(WORD_BITS),
            "take": In(1),
        }
        for name in ("ack", "refused", "hello", "status"):
            ports |= {f"{name}_valid": In(1), f"{name}_ready": Out(1)}
        if config.chip:
            # Events that follow another event closely may be short; the time begins anew; no event comes for now.
            ports |= {"short": In(1), "restart": In(1), "rests": In(1)}
        if self.classes:
            ports |= {
                "class_valid": In(1),
                "class_index": In(6),
                "class_overrun": In(1),
                "class_sure": In(1),
                "evidence": In(self.classes * self.evidence_bits),  # stays until its last word is written
            }
        super().__init__(ports)

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        m.submodules.memory = memory = SyncFIFOBuffered(width=WORD_BITS, depth=self.config.serial.records)
        told = Signal(VALUE_BITS)  # high bits of the time, as the host has them
        time, address = Signal(CLOCK_BITS), Signal(ADDRESS_BITS)
        has_event = Signal()
        index = Signal(range(max(self.classes, len(HELLO_WORDS), len(STATUS_WORDS)) + 1))
        written = Signal()
        m.d.comb += [
            self.level.eq(memory.r_level),
            self.word.eq(memory.r_data),
            memory.r_en.eq(self.take),
            written.eq(memory.w_en & memory.w_rdy),
        ]
        low, high = time[:TIME_BITS], time[TIME_BITS:]
        if self.config.chip:
            self._open(m)
        classes = self.class_valid if self.classes else Const(0, 1)
        with m.FSM():
            with m.State("IDLE"):
                m.d.comb += self.idle.eq(1)
                m.d.sync += [index.eq(0), time.eq(self.event_time), has_event.eq(self.event_valid)]
                with m.If(self.event_valid | classes):
                    m.d.sync += address.eq(self.event_address)
                    self._keep_class(m)
                    m.next = "LOST"
                with m.Else():
                    self._answer(m, memory)
            with m.State("LOST"):
                with m.If(self.lost == 0):
                    m.next = "TIME"
                    if self.config.chip:
                        self._shorten(m, time, address, has_event)
                with m.Else():
                    self._put(m, memory, Tag.LOST, self.lost)
                    m.d.comb += self.lost_told.eq(written)
            with m.State("TIME"):
                with m.If(told == high):
                    m.next = "EVENT"
                with m.Else():
                    self._put(m, memory, Tag.TIME, high)
                    with m.If(written):
                        m.d.sync += told.eq(high)
            with m.State("EVENT"):
                with m.If(has_event):
                    self._put(m, memory, Tag.EVENT, Cat(low, address))
                    if self.config.chip:
                        m.d.sync += [self.last.eq(Cat(time, address)), self.has_last.eq(1)]
                with m.If(written | ~has_event):
                    m.next = "CLASS" if self.classes else "IDLE"
            if self.config.chip:
                self._shift(m, memory, has_event, written)
            if self.classes:
                self._classes(m, memory, low, index, written)
            hello = hello_values(self.config)
            self._words(m, memory, Tag.HELLO, [Const(hello[n], WORD_BITS) for n in HELLO_WORDS], index, written)
            parts = [self.status_words.word_select(n, WORD_BITS) for n in range(len(STATUS_WORDS))]
            self._words(m, memory, Tag.STATUS, parts, index, written)
        return m

    def _answer(self, m: Module, memory: Any) -> None:
        """Fill up the word of short events, then write the next record that is neither event nor class."""
        others = self.refused_valid | self.ack_valid | self.hello_valid | self.status_valid
        waits = (self.filled != 0) & (others | self.rests) if self.config.chip else Const(0, 1)
        with m.If(waits):
            if self.config.chip:
                m.next = "FILL"
        with m.Elif(self.refused_valid):
            self._put(m, memory, Tag.REFUSED, self.refused_word)
            m.d.comb += self.refused_ready.eq(memory.w_rdy)
        with m.Elif(self.ack_valid):
            self._put(m, memory, Tag.ACK, self.ack_sequence)
            m.d.comb += self.ack_ready.eq(memory.w_rdy)
        with m.Elif(self.hello_valid):
            m.next = "HELLO"
        with m.Elif(self.status_valid):
            m.next = "STATUS"

    def _open(self, m: Module) -> None:
        """Add the registers of short events."""
        self.last = Signal(CLOCK_BITS + ADDRESS_BITS)
        self.has_last = Signal()
        self.word_of_short = Signal(VALUE_BITS)
        self.filled = Signal(range(VALUE_BITS + 1))
        self.code = Signal(1 + INTERVAL_BITS + 1 + self.address_bits)
        self.left = Signal(range(len(self.code) + 1))
        with m.If(self.restart):
            m.d.sync += self.has_last.eq(0)

    def _shorten(self, m: Module, time: Signal, address: Signal, has_event: Signal) -> None:
        """Choose the code of a short event from its interval and its address.

        The code has the interval if it is not the usual interval, and the address if it is not the next address.

        Otherwise the word of short events is filled first.
        """
        usual = additions(self.config) >> COUNT_BITS
        passed = Signal(CLOCK_BITS)
        m.d.comb += passed.eq(time - self.last[:CLOCK_BITS])
        near = self.short & self.has_last & has_event & (passed < PADDING)
        follows = address == (self.last[CLOCK_BITS:] + 1)[:ADDRESS_BITS]
        place = Mux(follows, 0, Cat(Const(1, 1), address[: self.address_bits]))
        place_bits = Mux(follows, 1, 1 + self.address_bits)
        interval = Cat(Const(1, 1), passed[:INTERVAL_BITS])
        with m.If(near):
            m.d.sync += [
                self.code.eq(Mux(passed == usual, Cat(Const(0, 1), place), Cat(interval, place))),
                self.left.eq(place_bits + Mux(passed == usual, 1, len(interval))),
                self.last.eq(Cat(time, address)),
                has_event.eq(0),
            ]
            m.next = "SHIFT"
        with m.Elif(self.filled != 0):
            m.next = "FILL"

    def _shift(self, m: Module, memory: Any, has_event: Signal, written: Signal) -> None:
        """Add the states that shift in the code of a short event, and that fill up the last word."""
        full = self.filled == VALUE_BITS
        has_class = self.has_class if self.classes else Const(0, 1)
        for name, bit, ends in (("SHIFT", self.code[0], self.left == 0), ("FILL", Const(1, 1), self.filled == 0)):
            with m.State(name):
                with m.If(full):
                    self._put(m, memory, Tag.SHORT, self.word_of_short)
                    with m.If(written):
                        m.d.sync += self.filled.eq(0)
                        if name == "FILL":
                            m.d.sync += self.has_last.eq(0)  # a record that is no short event ends the short events
                with m.Elif(ends):
                    m.next = "IDLE"
                    with m.If(has_event | has_class):
                        m.next = "LOST"
                with m.Else():
                    m.d.sync += [
                        self.word_of_short.eq(Cat(self.word_of_short[1:], bit)),
                        self.filled.eq(self.filled + 1),
                        self.code.eq(self.code[1:]),
                        self.left.eq(self.left - 1),
                    ]

    def _keep_class(self, m: Module) -> None:
        """Capture the class that the chip reports in this clock."""
        if not self.classes:
            return
        self.has_class, self.kept = Signal(), Signal(ADDRESS_BITS)
        kept = Cat(self.class_index, Const(0, ADDRESS_BITS - 8), self.class_sure, self.class_overrun)
        m.d.sync += [self.has_class.eq(self.class_valid), self.kept.eq(kept)]

    def _classes(self, m: Module, memory: Any, low: Value, index: Signal, written: Signal) -> None:
        """Add the states that write a class and its evidence."""
        with m.State("CLASS"):
            with m.If(self.has_class):
                self._put(m, memory, Tag.CLASS, Cat(low, self.kept))
                with m.If(written):
                    m.next = "EVIDENCE"
            with m.Else():
                m.next = "IDLE"
        with m.State("EVIDENCE"):
            value = self.evidence.word_select(index, self.evidence_bits).as_signed()
            m.d.comb += [memory.w_en.eq(1), memory.w_data.eq(value)]
            with m.If(written):
                m.d.sync += index.eq(index + 1)
                with m.If(index == self.classes - 1):
                    m.next = "IDLE"

    def _words(self, m: Module, memory: Any, tag: Tag, words: list[Value], index: Signal, written: Signal) -> None:
        """Add the state that writes a record of several words."""
        with m.State(tag.name):
            above = additions(self.config) << COUNT_BITS if tag == Tag.HELLO else 0
            first = Const(tag << VALUE_BITS | above | len(words), WORD_BITS)
            m.d.comb += [memory.w_en.eq(1), memory.w_data.eq(Mux(index == 0, first, Array(words)[index - 1]))]
            with m.If(written):
                m.d.sync += index.eq(index + 1)
                with m.If(index == len(words)):
                    m.d.comb += getattr(self, f"{tag.name.lower()}_ready").eq(1)
                    m.next = "IDLE"

    def _put(self, m: Module, memory: Any, tag: Tag, value: Any) -> None:
        """Write a record of one word."""
        m.d.comb += [
            memory.w_en.eq(1),
            memory.w_data.eq(Cat(value, Const(0, WORD_BITS))[:VALUE_BITS] | tag << VALUE_BITS),
        ]
