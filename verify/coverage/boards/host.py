"""Host on the serial line of a simulated board: sends frames and checks the records."""

import random
from collections.abc import Iterable
from typing import Any

import cocotb
from cocotb.triggers import FallingEdge, Timer

from eskin.board.config import ADDRESS_BITS, DESIGNS, BoardConfig
from eskin.board.records import VERSION, Ack, Class, Event, Feature, Lost, Record, RecordReader, Refused, Tag, Words
from eskin.board.serial_frames import Damaged, Frame, FrameReader, Kind
from eskin.cocotb_tests.bench.line import CLOCK_NS

JOB = "ESKIN_BOARD_COVERAGE"
RUN_CLOCKS = (0, 1, 255, 4000)
"""Numbers of clocks without a sample after the last sample."""

QUIET_BITS = 700
"""Bit times without a byte after which the board has sent everything, longer than any record on the line."""


class Mismatch(AssertionError):
    """Raised if the records of the board differ from the expected ones (docs/reference/board.md)."""


class Host:
    """A host with the records that it expects from the board."""

    def __init__(self, dut: Any, config: BoardConfig, rng: random.Random) -> None:
        self.dut, self.config, self.rng = dut, config, rng
        self.bit_ns = int(config.serial.clocks_per_bit * CLOCK_NS)
        self.classes = config.chip.classifier.classes if config.chip else 0
        self.interval = -(-config.chip.classifier.hidden // config.chip.classifier.lanes) if config.chip else 0
        self.listening: Any = None
        self._begin()

    def _begin(self) -> None:
        chip = self.config.chip
        described = (chip.classifier.inputs, self.interval) if chip else ()
        self.frames, self.records = FrameReader(), RecordReader(self.classes, *described)
        self.begun, self.due, self.sequence, self.taken, self.refused = False, 0, 1, 0, 0
        self.said: list[Record] = []  # not yet compared with the expected ones
        self.data: list[Record] = []  # events, classes and losses, since the last restart
        self.counted = {"events": 0, "bins": 0, "lost": 0}
        self.came = 0

    # -- the line --------------------------------------------------------------------------------

    async def bits(self, count: float) -> None:
        """Wait for a number of bit times."""
        await Timer(round(count * self.bit_ns), "ns")

    async def level(self, value: int, count: float) -> None:
        """Drive the serial line to the board to a level for a number of bit times."""
        self.dut.rx.value = value
        await self.bits(count)

    async def put(self, data: bytes) -> None:
        """Send bytes without gaps."""
        for byte in data:
            for bit in (0, *(byte >> n & 1 for n in range(8)), 1):
                await self.level(bit, 1)

    async def _listen(self) -> None:
        tx = self.dut.tx
        while True:
            await FallingEdge(tx)
            await self.bits(1.5)
            byte = 0
            for n in range(8):
                byte |= int(tx.value) << n
                await self.bits(1)
            if not int(tx.value):
                raise Mismatch("a byte from the board has no stop bit")
            self.came += 1
            for frame in self.frames.feed(bytes([byte])):
                self._hand_on(frame)

    def _hand_on(self, frame: Frame | Damaged) -> None:
        """Process a frame from the board; skip frames of an earlier session."""
        if not self.begun:
            if isinstance(frame, Damaged) or frame.sequence or frame.payload[3] >> 4 != Tag.HELLO:
                return
            self.begun = True
        if isinstance(frame, Damaged) or frame.kind != Kind.RECORDS or frame.sequence != self.due:
            raise Mismatch(f"frame {self.due} of the board is {frame}")
        self.due = (self.due + 1) % 256
        for record in self.records.feed(frame.payload):
            (self.data if isinstance(record, Event | Class | Lost) else self.said).append(record)
            self.counted["events"] += isinstance(record, Event)
            self.counted["bins"] += isinstance(record, Class)
            self.counted["lost"] += record.count if isinstance(record, Lost) else 0

    async def quiet(self) -> None:
        """Wait until the board sends nothing more."""
        before = -1
        while before != self.came:
            before = self.came
            await self.bits(QUIET_BITS)

    async def heard(self) -> list[Record]:
        """Receive until the board is quiet, and return the records that are not data."""
        await self.quiet()
        said, self.said = self.said, []
        return said

    async def expect(self, *records: Record) -> None:
        """Receive until the board is quiet, and compare the records with the expected ones."""
        if (said := await self.heard()) != list(records):
            raise Mismatch(f"the board says {said}; it must say {list(records)}")

    # -- sessions --------------------------------------------------------------------------------

    async def reset(self, clocks: int = 5) -> None:
        """Reset the board by its pin, and wait for its first records."""
        if self.listening is not None:
            self.listening.cancel()
        self.dut.rst.value = 1
        self.dut.rx.value = 1
        await Timer(clocks * CLOCK_NS, "ns")
        self.dut.rst.value = 0
        self._begin()
        self.sequence = 0
        self.listening = cocotb.start_soon(self._listen())
        await self.expect(self.hello_words)

    @property
    def hello_words(self) -> Words:
        """Return the expected description of the board."""
        serial, chip = self.config.serial, self.config.chip
        values = {"version": VERSION, "design": DESIGNS.index(self.config.design) + 1}
        values |= {"identity": self.config.identity, "clock_hz": serial.clock_hz, "buffer_bytes": serial.buffer_bytes}
        channels, size, above = 1 << ADDRESS_BITS, 0, 0
        if chip:
            above = Feature.CHANGES | Feature.SHORT_EVENTS | Feature.EARLY | self.interval << 8
            channels = chip.classifier.inputs
            size = max(chip.classifier.lanes * chip.classifier.weight_bits, chip.classifier.neuron_bits)
        values |= {"channels": channels, "classes": self.classes, "word_bytes": -(-size // 8)}
        return Words(Tag.HELLO, values, above)

    async def hello(self, number: int = 0, wait: bool = True) -> None:
        """Start a session."""
        await self.put(Frame(Kind.HELLO, number, b"").encode())
        self._begin()
        self.sequence = (number + 1) % 256
        if wait:
            await self.expect(self.hello_words)

    # -- frames ----------------------------------------------------------------------------------

    async def send(self, kind: int, payload: bytes = b"") -> Ack:
        """Send a valid frame, and return the expected acknowledgement."""
        number, self.sequence = self.sequence, (self.sequence + 1) % 256
        await self.put(Frame(kind, number, payload).encode())
        self.taken += 1
        if kind == Kind.RESTART:
            self.data = []
        return Ack(number)

    async def carry_out(self, kind: int, payload: bytes = b"") -> None:
        """Send a valid frame, and check its acknowledgement."""
        await self.expect(await self.send(kind, payload))

    async def unknown(self, kind: int, payload: bytes = b"") -> None:
        """Send a frame of unknown kind or of wrong length, and check its rejection."""
        number = (await self.send(kind, payload)).sequence
        self.refused += 1
        await self.expect(Refused(number, number, 4))

    async def bad(self, data: bytes, reason: int, number: int | None = None) -> None:
        """Send an invalid frame, and check its rejection."""
        await self.put(data)
        self.refused += 1
        said = await self.heard()
        first = said[0] if said else None
        ok = len(said) == 1 and isinstance(first, Refused)
        if not ok or (first.expected, first.reason) != (self.sequence, reason) or number not in (None, first.sequence):  # type: ignore[union-attr]
            raise Mismatch(f"the board says {said}; it must refuse {number} for {reason}, due is {self.sequence}")

    async def status(self, **values: int) -> dict[str, int]:
        """Query the counters of the board, and check them."""
        ack = await self.send(Kind.STATUS)
        said = await self.heard()
        if len(said) != 2 or not isinstance(said[0], Words) or said[1] != ack:
            raise Mismatch(f"the board says {said}; it must say its status, and {ack}")
        known = {"taken": self.taken, "refused": self.refused, **self.counted, **values}
        found = {name: said[0].values[name] for name in known}
        if found != known:
            raise Mismatch(f"the board counts {found}; it must count {known}")
        return said[0].values


def damaged(frame: Frame, at: Iterable[int]) -> bytes:
    """Return the bytes of a frame with bits flipped, without creating flag or escape bytes."""
    data = bytearray(frame.encode())
    for place in at:
        data[place] ^= next(bit for bit in (1, 2, 4) if data[place] ^ bit not in (0x7E, 0x7D))
    return bytes(data)
