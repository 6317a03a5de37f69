"""Host side of the serial protocol: send frames within the buffer space of the board, receive records."""

from __future__ import annotations

import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from eskin.base.errors import InputError
from eskin.board.config import DESIGNS, BoardConfig, Design, SerialConfig
from eskin.board.records import VALUE_BITS, Ack, Feature, Reason, Record, RecordReader, Refused, Tag, Words, additions
from eskin.board.serial_frames import Damaged, Frame, FrameReader, Kind

POLL_S = 0.05
MAX_S = 600.0  # longest execution of a frame while records arrive: a RUN may give millions of events
WORD_BYTES = 4

WHY: dict[int, str] = {
    Reason.DAMAGED: "arrived damaged",
    Reason.SEQUENCE: "arrived out of order, because an earlier frame was lost",
    Reason.OVERRUN: "did not fit into the buffer of the board",
    Reason.UNKNOWN: "has a kind that the board does not know; load its bitstream again",
}


class Link:
    """Connection to a board at a serial device.

    A separate thread reads, so that no byte is lost while the program is busy. ``sink`` takes the records of each
    frame, in order. A board that sends nothing for ``patience_s`` is lost.
    """

    def __init__(
        self, port: str, sink: Callable[[list[Record]], object], baud: int = SerialConfig.baud, patience_s: float = 3.0
    ) -> None:
        import serial

        self.port, self.sink, self.patience_s = port, sink, patience_s
        self.said: dict[str, int] = {}
        self.features = Feature(0)  # of the board, beside the first protocol
        self._frames, self._records = FrameReader(), RecordReader()
        self._sequence = self._due = 0
        self._waiting: deque[Frame] = deque()
        self.arrived = 0.0  # ``time.monotonic`` at the arrival of the bytes that are forwarded now
        self._came: queue.Queue[tuple[float, bytes | Exception]] = queue.Queue()
        self._closing = False
        try:
            self._line = serial.Serial(port, baud, timeout=POLL_S, write_timeout=patience_s, exclusive=True)
            self._line.reset_input_buffer()
        except (OSError, ValueError) as error:
            reason = str(getattr(error, "strerror", None) or error)
            raise InputError(f"no board at {port}: {reason}; give the name of its port, such as /dev/ttyUSB0") from None
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def __enter__(self) -> Link:
        return self

    def __exit__(self, *error: Any) -> None:
        self._closing = True
        self._thread.join(timeout=1)
        self._line.close()

    def hello(self, design: Design, config: BoardConfig | None = None) -> dict[str, int]:
        """Start a session, and return the description that the board sends.

        Raises InputError if nothing answers, or the board has another design or another chip.
        """
        self._frames, self._records = FrameReader(), RecordReader()
        self._waiting.clear()
        self._due, begun = 0, False
        self._write(Frame(Kind.HELLO, 0, b""))
        self._sequence = 1
        ends = time.monotonic() + self.patience_s
        while not self.said:
            if time.monotonic() > ends:
                raise InputError(
                    f"no board answers at {self.port}; load its bitstream (make fpga), and check the cable and the "
                    f"baud rate"
                )
            for frame in self._frames.feed(self._take()):
                begun = begun or self._begins(frame)
                if begun:
                    self._hand_on(frame)
        self._check(design, config)
        return self.said

    def send(self, kind: Kind, payload: bytes = b"") -> None:
        """Send a frame as soon as the board has buffer space; forward received records meanwhile."""
        frame = Frame(kind, self._sequence, payload)
        self._sequence = (self._sequence + 1) % 256
        room = self.said["buffer_bytes"] - frame.cost
        self._until(lambda: sum(f.cost for f in self._waiting) <= max(room, 0), MAX_S)
        self._waiting.append(frame)
        self._write(frame)
        while not self._came.empty():
            self._handle(self._take())

    def receive(self) -> None:
        """Wait for bytes and forward their records to the sink.

        Raises InputError if the board sends nothing, is gone or rejects a frame, or if a frame arrives damaged.
        """
        ends = time.monotonic() + self.patience_s
        while not (data := self._take()):
            if time.monotonic() > ends:
                raise InputError(
                    f"the board at {self.port} has sent nothing for {self.patience_s:g} s; check the cable"
                )
        self._handle(data)

    @property
    def unfinished(self) -> int:
        """Number of frames that the board has not yet acknowledged."""
        return len(self._waiting)

    def wait(self, seconds: float = MAX_S) -> None:
        """Wait until the board has executed all frames; raise InputError if a frame takes longer than ``seconds``."""
        self._until(lambda: not self._waiting, seconds)

    def waited_s(self) -> float:
        """Return how many seconds ago this machine received the current bytes."""
        return time.monotonic() - self.arrived

    def _until(self, done: Callable[[], bool], seconds: float) -> None:
        """Forward received records until a condition holds."""
        left, ends = len(self._waiting), time.monotonic() + seconds
        while not done():
            self.receive()
            if len(self._waiting) < left:
                left, ends = len(self._waiting), time.monotonic() + seconds
            elif time.monotonic() > ends:
                raise InputError(
                    f"the board at {self.port} sends, but has not acknowledged frame {self._waiting[0].sequence} for "
                    f"{seconds:g} s; load its bitstream again"
                )

    def pause(self, seconds: float) -> None:
        """Forward received records for a given time."""
        ends = time.monotonic() + seconds
        while (left := ends - time.monotonic()) > 0:
            self._handle(self._take(min(left, POLL_S)))

    def _read(self) -> None:
        """Put received bytes into the queue (in the reader thread)."""
        try:
            while not self._closing:
                if data := self._line.read(max(1, self._line.in_waiting)):
                    self._came.put((time.monotonic(), data))
        except Exception as error:  # pyserial raises its own, the system's, and TypeError where it was closed
            self._came.put((time.monotonic(), error))

    def _take(self, seconds: float = POLL_S) -> bytes:
        """Return received bytes, or none after a short wait."""
        try:
            self.arrived, found = self._came.get(timeout=seconds)
        except queue.Empty:
            return b""
        if isinstance(found, Exception):
            raise InputError(f"the board at {self.port} is gone; check the cable") from None
        return found

    def _write(self, frame: Frame) -> None:
        try:
            self._line.write(frame.encode())
        except OSError:  # pyserial's errors are of this kind
            raise InputError(f"the board at {self.port} is gone; check the cable") from None

    def _begins(self, frame: Frame | Damaged) -> bool:
        """Return True if a frame starts the current session, False for a frame of an earlier session."""
        if isinstance(frame, Damaged) or frame.kind != Kind.RECORDS or frame.sequence:
            return False
        return int.from_bytes(frame.payload[:WORD_BYTES], "little") >> VALUE_BITS == Tag.HELLO

    def _handle(self, data: bytes) -> None:
        for frame in self._frames.feed(data):
            self._hand_on(frame)

    def _hand_on(self, frame: Frame | Damaged) -> None:
        """Forward the records of a frame to the sink."""
        if isinstance(frame, Damaged):
            raise InputError(
                f"a frame from the board arrived damaged ({frame.reason}); check cable and baud rate, and play again"
            )
        if frame.sequence != self._due:
            missing = (frame.sequence - self._due) % 256
            raise InputError(f"{missing} frames from the board were lost before number {frame.sequence}; play again")
        self._due = (self._due + 1) % 256
        if frame.kind != Kind.RECORDS:
            raise InputError(f"the board sent a frame of the unknown kind {frame.kind}; load its bitstream again")
        records: list[Record] = []
        try:
            for record in self._records.feed(frame.payload):
                if isinstance(record, Ack):
                    self._acknowledged(record.sequence)
                elif isinstance(record, Refused):
                    why = WHY.get(record.reason, "was refused")
                    raise InputError(f"frame {record.sequence} to the board {why} (it waits for {record.expected})")
                elif isinstance(record, Words) and record.tag == Tag.HELLO:
                    self.said, self.features = record.values, record.features
                    self._records.classes, self._records.addresses = self.said["classes"], self.said["channels"]
                    self._records.interval = record.interval
                else:
                    records.append(record)
        finally:
            if records:
                self.sink(records)

    def _acknowledged(self, sequence: int) -> None:
        if not self._waiting or self._waiting[0].sequence != sequence:
            raise InputError(f"the board acknowledged frame {sequence}, which is not the next frame; start again")
        self._waiting.popleft()

    def _check(self, design: Design, config: BoardConfig | None) -> None:
        """Check that the board has the expected design."""
        said: dict[str, Any] = self.said
        held = DESIGNS[said["design"] - 1] if 0 < said["design"] <= len(DESIGNS) else f"design {said['design']}"
        if held != design:
            raise InputError(
                f"the board holds the {held}, but this command needs the {design}; load that bitstream (make fpga)"
            )
        if config is not None and said["identity"] != config.identity:
            raise InputError(
                f"the board's bitstream has another network or array ({said['identity']:08x}, not "
                f"{config.identity:08x}); load the bitstream for these weights (make fpga WEIGHTS=)"
            )
        if config is not None and additions(config) & Feature.EARLY and not self.features & Feature.EARLY:
            raise InputError("the board sends no early decisions; build its bitstream again (make fpga WEIGHTS=)")
