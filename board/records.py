"""Records from a board: tagged 32-bit words in order of time (docs/reference/board.md)."""

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import NamedTuple

from eskin.base.errors import InputError
from eskin.board.config import ADDRESS_BITS, DESIGNS, MAX_CLASSES, BoardConfig
from eskin.board.serial_frames import MAX_PAYLOAD
from eskin.model.classifier.run import ClassifierRun

TIME_BITS = 16  # low bits of the time in a record; a separate record carries the high bits when they change
WORD_BITS, TAG_BITS = 32, 4
VALUE_BITS = WORD_BITS - TAG_BITS
LOW_TIME = (1 << TIME_BITS) - 1
EVENTS_END = 1 << VALUE_BITS  # words below have the tag 0 of events
INTERVAL_BITS = 8
PADDING = (1 << INTERVAL_BITS) - 1  # interval that begins no event: the rest of the word is empty

COUNT_BITS = 8
"""Low bits of the first word of ``HELLO``, with the number of following words.

``Feature`` and the usual interval are in the bits above.
"""


class Tag(IntEnum):
    """Tag in the upper four bits of the first word of a record."""

    EVENT = 0
    TIME = 1
    LOST = 2
    CLASS = 3
    ACK = 4
    REFUSED = 5
    HELLO = 6
    STATUS = 7
    SHORT = 8


class Feature(IntFlag):
    """Features of a board that the first protocol did not have.

    Earlier boards report 0, and earlier hosts ignore these features.
    """

    CHANGES = 1
    SHORT_EVENTS = 2
    SENSOR = 4
    EARLY = 8


class Reason(IntEnum):
    """Reasons why a board rejects a frame."""

    DAMAGED = 1
    SEQUENCE = 2
    OVERRUN = 3
    UNKNOWN = 4


VERSION = 1  # version of frames and records
HELLO_WORDS = ("version", "design", "identity", "clock_hz", "buffer_bytes", "channels", "classes", "word_bytes")
STATUS_WORDS = ("time_low", "time_high", "events", "bins", "taken", "refused", "lost", "stalls")
"""Words after the first word of each of these records."""
NAMES = {Tag.HELLO: HELLO_WORDS, Tag.STATUS: STATUS_WORDS}

RANGES = {
    "clock_hz": (1000, 10**9),
    "buffer_bytes": (512, 2**24),
    "channels": (1, 1 << ADDRESS_BITS),
    "classes": (0, MAX_CLASSES),
    "word_bytes": (0, MAX_PAYLOAD - 3),
}
"""Least and largest number in the description of a board."""

AGAIN = "load its bitstream again"


class Event(NamedTuple):
    """Address event: clock, and channel of the chip or address of another chip."""

    time: int
    address: int


@dataclass(frozen=True)
class Class:
    """Classifier output at the end of a bin: clock of ``class_valid``, class, overrun flag, evidence, class_sure."""

    time: int
    winner: int
    overrun: bool
    evidence: tuple[int, ...]
    sure: bool = False


@dataclass(frozen=True)
class Lost:
    """Number of events lost to a full FIFO before the next event."""

    count: int


@dataclass(frozen=True)
class Ack:
    """Acknowledgement of an executed frame by its sequence number."""

    sequence: int


@dataclass(frozen=True)
class Refused:
    """Rejection of a frame: its sequence number (unreliable), and the expected sequence number."""

    sequence: int
    expected: int
    reason: int


@dataclass(frozen=True)
class Words:
    """Description (``HELLO_WORDS``) or counters (``STATUS_WORDS``) of a board, by name."""

    tag: Tag
    values: dict[str, int]
    above: int = 0  # part of a description: ``Feature`` in the low 8 bits, then the usual clocks between short events

    @property
    def features(self) -> Feature:
        """Features that the board has in addition to the first protocol."""
        return Feature(self.above & (1 << COUNT_BITS) - 1) & Feature(sum(Feature))

    @property
    def interval(self) -> int:
        """Usual number of clocks between short events."""
        return self.above >> COUNT_BITS & (1 << INTERVAL_BITS) - 1


Record = Event | Class | Lost | Ack | Refused | Words


class RecordReader:
    """Parser that converts words to records.

    A class has ``classes`` words of evidence, and short events have usually ``interval`` clocks between them.
    """

    def __init__(self, classes: int = 0, addresses: int = 1 << ADDRESS_BITS, interval: int = 1) -> None:
        self.classes, self.addresses, self.interval = classes, addresses, interval
        self._high = 0
        self._begun: list[int] = []
        self._last = Event(0, 0)
        self._bits = self._count = 0

    def feed(self, payload: bytes) -> Iterator[Record]:
        """Yield the records completed by the payload of a frame.

        Raises InputError for records that no board of this version sends.
        """
        if len(payload) % 4:
            raise InputError(f"the board sent {len(payload)} bytes of records, which are not whole words; {AGAIN}")
        for (word,) in struct.iter_unpack("<I", payload):
            if not self._begun:
                if word >> VALUE_BITS == Tag.SHORT:
                    yield from self._short(word & EVENTS_END - 1)
                    continue
                self._bits = self._count = 0  # any other record ends the bits of short events
                if word < EVENTS_END:  # a fast path for nearly all records
                    self._last = self._event(self._high << TIME_BITS | word & LOW_TIME, word >> TIME_BITS)
                    yield self._last
                    continue
            self._begun.append(word)
            if len(self._begun) > self._follow(self._begun[0]):
                words, self._begun = self._begun, []
                if (record := self._record(words)) is not None:
                    yield record

    def _short(self, value: int) -> Iterator[Event]:
        """Yield the short events whose codes end in a word.

        A code may continue in the next word.
        """
        bits, count = self._bits | value << self._count, self._count + VALUE_BITS
        size = (self.addresses - 1).bit_length()
        time, address = self._last
        while True:
            used = 1 + INTERVAL_BITS * (bits & 1)
            interval = bits >> 1 & PADDING if bits & 1 else self.interval
            far = bits >> used & 1
            used += 1 + size * far
            if used > count or interval == PADDING:
                break
            time += interval
            address = bits >> used - size & (1 << size) - 1 if far else address + 1
            bits, count = bits >> used, count - used
            yield self._event(time, address)
        self._bits, self._count, self._last = bits, count, Event(time, address)

    def _event(self, time: int, address: int) -> Event:
        if address >= self.addresses:
            raise InputError(
                f"the board sent an event with the address {address}, but has {self.addresses} addresses; {AGAIN}"
            )
        return Event(time, address)

    def _follow(self, first: int) -> int:
        tag = first >> VALUE_BITS
        if tag == Tag.CLASS:
            return self.classes
        return first & 0xFF if tag in NAMES else 0

    def _record(self, words: list[int]) -> Record | None:
        tag, value = words[0] >> VALUE_BITS, words[0] & (1 << VALUE_BITS) - 1
        time = self._high << TIME_BITS | value & (1 << TIME_BITS) - 1
        above = value >> TIME_BITS
        if tag == Tag.TIME:
            self._high = value
            return None
        if tag == Tag.LOST:
            return Lost(value)
        if tag == Tag.CLASS:
            if above & 0x3F >= self.classes:
                raise InputError(f"the board sent the class {above & 0x3F}, but has {self.classes} classes; {AGAIN}")
            evidence = tuple(word - (word >> WORD_BITS - 1 << WORD_BITS) for word in words[1:])  # signed
            overrun, sure = (bool(above >> ADDRESS_BITS - place & 1) for place in (1, 2))
            return Class(time, above & 0x3F, overrun, evidence, sure)
        if tag == Tag.ACK:
            return Ack(value & 0xFF)
        if tag == Tag.REFUSED:
            return Refused(value & 0xFF, value >> 8 & 0xFF, above)
        if tag in NAMES:
            above = words[0] >> COUNT_BITS & (1 << VALUE_BITS - COUNT_BITS) - 1
            return Words(Tag(tag), said(Tag(tag), words[1:]), above)
        raise InputError(f"the board sent a record with the unknown tag {tag}; {AGAIN}")


def said(tag: Tag, words: list[int]) -> dict[str, int]:
    """Return the description or the counters of a board by name.

    Raises InputError if words are missing, a number is outside ``RANGES``, or the board has another version.
    """
    names = NAMES[tag]
    values = dict(zip(names, words, strict=False))
    if tag == Tag.HELLO and values.get("version", VERSION) != VERSION:
        raise InputError(
            f"the board uses protocol version {values['version']}, but this program uses {VERSION}; {AGAIN}"
        )
    if len(words) != len(names):
        raise InputError(f"the board describes itself in {len(words)} numbers, not {len(names)}; {AGAIN}")
    for name, (low, high) in RANGES.items() if tag == Tag.HELLO else ():
        if not low <= values[name] <= high:
            raise InputError(f"the board reports {name} = {values[name]}, outside {low}..{high}; {AGAIN}")
    return values


def hello_values(config: BoardConfig) -> dict[str, int]:
    """Return the values of a HELLO record, by their names in ``HELLO_WORDS``."""
    classifier = config.chip.classifier if config.chip else None
    return {
        "version": VERSION,
        "design": DESIGNS.index(config.design) + 1,
        "identity": config.identity,
        "clock_hz": config.serial.clock_hz,
        "buffer_bytes": config.serial.buffer_bytes,
        "channels": classifier.inputs if classifier else 1 << ADDRESS_BITS,
        "classes": classifier.classes if classifier else 0,
        "word_bytes": config.word_bytes,
    }


def classes_of(run: ClassifierRun, clocks: int) -> list[Class]:
    """Return the classes that a run of the classifier reports before a clock."""
    late = min(run.overruns, default=clocks)
    return [
        Class(valid, one.winner, valid > late, tuple(one.evidence.tolist()), one.sure)
        for valid, one in zip(run.valid, run.bins, strict=True)
        if valid < clocks
    ]


def additions(config: BoardConfig) -> int:
    """Return the bits above the word count in a board's description: features and the usual interval."""
    if config.chip is None:
        return 0
    interval = min(config.chip.classifier.groups, PADDING - 1)
    features = Feature.CHANGES | Feature.SHORT_EVENTS
    features |= Feature.SENSOR if config.sensor else Feature(0)
    features |= Feature.EARLY if config.chip.classifier.margin else Feature(0)
    return features | interval << COUNT_BITS


class RecordWriter:
    """Encoder that converts records to words, as the board does."""

    def __init__(self) -> None:
        self._high = 0

    def feed(self, records: Iterable[Record]) -> list[int]:
        """Return the words of the next records."""
        return [word for record in records for word in self._words(record)]

    def _words(self, record: Record) -> list[int]:
        match record:
            case Event(time, address):
                return self._timed(Tag.EVENT, time, address)
            case Class(time, winner, overrun, evidence, sure):
                flags = overrun << ADDRESS_BITS - 1 | sure << ADDRESS_BITS - 2
                words = self._timed(Tag.CLASS, time, flags | winner)
                return words + [value & (1 << WORD_BITS) - 1 for value in evidence]
            case Lost(count):
                return [_word(Tag.LOST, count)]
            case Ack(sequence):
                return [_word(Tag.ACK, sequence)]
            case Refused(sequence, expected, reason):
                return [_word(Tag.REFUSED, reason << TIME_BITS | expected << 8 | sequence)]
            case Words(tag, values, above):
                names = NAMES[tag]
                return [_word(tag, len(names) | above << COUNT_BITS), *(values[name] for name in names)]

    def _timed(self, tag: Tag, time: int, above: int) -> list[int]:
        """Return the words of a record with a time, preceded by changed high bits of the time."""
        changed, self._high = time >> TIME_BITS != self._high, time >> TIME_BITS
        return [_word(Tag.TIME, self._high)] * changed + [_word(tag, above << TIME_BITS | time & LOW_TIME)]


def _word(tag: Tag, value: int) -> int:
    return tag << VALUE_BITS | value
