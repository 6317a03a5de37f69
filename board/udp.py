"""Send events over UDP in the format of jAER or faery (docs/reference/udp.md)."""

import socket
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError

PORT = 8991  # jAER's default port for unicast events
MAX_BYTES = 1500 - 28  # of a datagram in an Ethernet frame
FAERY = "faery://"  # before a destination, for the format t64_x16_y16_on8 of faery
FAERY_DTYPE = np.dtype([("t", "<u8"), ("x", "<u2"), ("y", "<u2"), ("on", "u1")])
LAST_COLUMN = 127  # of the 128 x 128 addresses of a DVS128, whose columns count from the right
MAX_NUMBER = (1 << 31) - 1
AddressEvent = tuple[int, int, int, bool]


def parse_destination(text: str) -> tuple[str, int]:
    """Return host and port for a text ``HOST:PORT`` or ``HOST``; raise InputError for other texts."""
    host, port = text.rsplit(":", 1) if text.count(":") == 1 or "]:" in text else (text, str(PORT))
    host = host.strip("[]")
    if not host or not port.isascii() or not port.isdigit() or not 0 < int(port) < 1 << 16:
        raise InputError(f"--udp takes HOST:PORT, such as 127.0.0.1:{PORT}, not {text!r}")
    return host, int(port)


class UdpSender:
    """UDP sender of events to ``HOST:PORT``, without acknowledgement; ``clock_hz`` is the clock of the events' times.

    The format is that of jAER, or that of faery for ``faery://HOST:PORT``.
    ``begins_us`` is added to all times, for a recording that follows another. A datagram that the system does not take
    at once is counted in ``failed``, because a recording must not wait for a network.
    """

    def __init__(self, destination: str, clock_hz: float) -> None:
        host, port = parse_destination(destination.removeprefix(FAERY))
        self._faery = destination.startswith(FAERY)
        self._most = (MAX_BYTES - 4) // 8 if not self._faery else MAX_BYTES // FAERY_DTYPE.itemsize
        try:
            family, kind, _, _, found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind)
            self._socket.setblocking(False)
        except OSError as error:
            raise InputError(f"cannot send to {destination}: {error.strerror}; give --udp HOST:PORT") from None
        self.destination, self._us_per_clock = destination, 1e6 / clock_hz
        self._to: tuple[Any, ...] = found
        self.events = self.begins_us = self._number = 0
        self.failed, self.reason = 0, ""  # datagrams that were not sent, and why the last was not

    def __call__(self, events: Sequence[AddressEvent]) -> None:
        """Send events (clock, column, row, polarity)."""
        for at in range(0, len(events), self._most):
            timed = np.array(events[at : at + self._most], np.int64)
            timed[:, 0] = self.begins_us + np.round(timed[:, 0] * self._us_per_clock)
            data = faery_datagram(timed) if self._faery else datagram(self._number, timed)
            self._number = self._number + 1 & MAX_NUMBER
            try:
                self._socket.sendto(data, self._to)
                self.events += len(timed)
            except OSError as error:
                self.failed, self.reason = self.failed + 1, str(error.strerror)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def datagram(number: int, events: NDArray[np.int64]) -> bytes:
    """Return a UDP datagram: its number, then address and time of each event, as big-endian 32-bit words.

    Events, shape (events, 4), are microseconds, column, row and polarity. The 32 low bits of the time are sent.
    """
    words = np.empty((len(events), 2), ">u4")
    words[:, 0] = events[:, 2] << 8 | LAST_COLUMN - events[:, 1] << 1 | 1 - events[:, 3]
    words[:, 1] = events[:, 0] & 0xFFFFFFFF
    return struct.pack(">I", number) + words.tobytes()


def faery_datagram(events: NDArray[np.int64]) -> bytes:
    """Return events, shape (events, 4), as faery reads them: 13 bytes for each, low byte first.

    Examples
    --------
    >>> faery_datagram(np.array([[3125, 3, 2, 1]])).hex(" ", 4)
    '35 0c000000 00000003 00020001'
    """
    found = np.empty(len(events), FAERY_DTYPE)
    for column, name in enumerate(FAERY_DTYPE.names or ()):
        found[name] = events[:, column]
    return found.tobytes()


def read_datagram(data: bytes) -> tuple[int, NDArray[np.int64]]:
    """Return the number and the events of a datagram.

    Examples
    --------
    >>> number, events = read_datagram(bytes.fromhex("00000007 000003f9 00000c35"))
    >>> number, events.tolist()
    (7, [[3125, 3, 3, 0]])
    """
    words = np.frombuffer(data, ">u4", offset=4).astype(np.int64).reshape(-1, 2)
    address = words[:, 0]
    columns = LAST_COLUMN - (address >> 1 & LAST_COLUMN)
    return int.from_bytes(data[:4], "big"), np.stack([words[:, 1], columns, address >> 8, 1 - (address & 1)], 1)
