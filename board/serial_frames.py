"""Frames on the serial line: flag, kind, sequence number, length, payload, CRC (docs/reference/board.md).

Flags and escapes are those of HDLC-like framing (RFC 1662), the CRC is that of Ethernet (``zlib.crc32``).
"""

import zlib
from collections.abc import Iterator
from enum import IntEnum
from typing import NamedTuple

FLAG, ESCAPE, FLIP = 0x7E, 0x7D, 0x20
HEAD_BYTES, CRC_BYTES = 3, 4
MAX_PAYLOAD = 255


class Kind(IntEnum):
    """Kinds of frames; the board sends only the last kind."""

    HELLO = 1
    RESTART = 2
    SAMPLES = 3
    RUN = 4
    WEIGHTS = 5
    STATUS = 6
    CHANGES = 7
    SENSE = 8
    RECORDS = 0x81


class Frame(NamedTuple):
    """A frame with a correct CRC."""

    kind: int
    sequence: int  # 0..255, one more than in the previous frame
    payload: bytes

    @property
    def cost(self) -> int:
        """Bytes of the board's buffer that the frame occupies until its execution."""
        return HEAD_BYTES + len(self.payload) + CRC_BYTES

    def encode(self) -> bytes:
        """Return the bytes for the serial line, with a flag at both ends."""
        if len(self.payload) > MAX_PAYLOAD:
            raise ValueError(f"a frame holds at most {MAX_PAYLOAD} bytes, not {len(self.payload)}")
        body = bytes([self.kind, self.sequence, len(self.payload)]) + self.payload
        body += zlib.crc32(body).to_bytes(CRC_BYTES, "little")
        stuffed = body.replace(bytes([ESCAPE]), bytes([ESCAPE, ESCAPE ^ FLIP]))
        stuffed = stuffed.replace(bytes([FLAG]), bytes([ESCAPE, FLAG ^ FLIP]))
        return bytes([FLAG]) + stuffed + bytes([FLAG])


class Damaged(NamedTuple):
    """Bytes between two flags that are not a valid frame."""

    reason: str


def decode(body: bytes) -> Frame | Damaged:
    """Return the frame for the bytes between two flags, with escapes resolved."""
    plain = bytearray()
    escaped = False
    for byte in body:
        if byte == ESCAPE and not escaped:
            escaped = True
            continue
        plain.append(byte ^ FLIP if escaped else byte)
        escaped = False
    found = bytes(plain)
    if escaped or len(found) < HEAD_BYTES + CRC_BYTES:
        return Damaged(f"it ends after {len(found)} bytes")
    if zlib.crc32(found[:-CRC_BYTES]) != int.from_bytes(found[-CRC_BYTES:], "little"):
        return Damaged("its CRC is wrong")
    if found[2] != len(found) - HEAD_BYTES - CRC_BYTES:
        return Damaged(f"its length says {found[2]} bytes, there are {len(found) - HEAD_BYTES - CRC_BYTES}")
    return Frame(found[0], found[1], found[HEAD_BYTES:-CRC_BYTES])


class FrameReader:
    """Parser that splits received bytes at the flags."""

    def __init__(self) -> None:
        self._open: bytearray | None = None

    def feed(self, data: bytes) -> Iterator[Frame | Damaged]:
        """Return the frames completed by these bytes."""
        *whole, rest = data.split(bytes([FLAG]))
        for part in whole:
            if self._open is not None and (self._open or part):
                yield decode(bytes(self._open) + part)
            self._open = bytearray()
        if self._open is not None:
            self._open += rest
