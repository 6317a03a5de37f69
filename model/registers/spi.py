"""Cycle-accurate model of the SPI slave: mode 0, sampled by the clock of the readout.

A transfer is a command of 16 bits, the most significant first, {write, address of 15 bits}, and then any number of
words of 32 bits, which go to rising addresses or come from them.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from eskin.model.registers.description import WORD_BITS, WORD_BYTES
from eskin.model.registers.file import Write

ADDRESS_BITS = 15
COMMAND_BITS = 1 + ADDRESS_BITS

HIGH_CLOCKS, LOW_CLOCKS, LOW_CLOCKS_TO_READ = 2, 2, 4
"""Least clocks of the readout in which SCK stays high, and low; the last where the host reads."""

LEAD_CLOCKS, LAG_CLOCKS, GAP_CLOCKS = 2, 2, 3
"""Least clocks from the fall of CS to the first rise of SCK, from the last to the rise of CS, and with CS high."""


class Pins(NamedTuple):
    """Logic levels that the host drives on the SPI pins."""

    sck: int = 0
    cs_n: int = 1
    mosi: int = 0


class SpiSlave:
    """The SPI slave; properties give its outputs before a rising edge, and ``clock`` applies the edge."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Reset the slave, which then ignores the bus until CS has been high."""
        # Pins as they were one clock before, two, and so on: the first two are the synchroniser.
        self.sck, self.cs_n, self.mosi = [0, 0, 0], [0, 0, 0, 0], [0, 0]
        self.active = False  # a transfer is under way: CS was high for two clocks and then low ever since
        self.in_data = self.writes = False  # the command is complete, and is a write
        self.count = 0  # bits of the word or command so far
        self.shift = self.bit = 0  # the last 32 bits, or the bits still to be read; the newest bit
        self.address = 0

    @property
    def rises(self) -> bool:
        """True if the slave samples a bit in this clock."""
        return self.active and not self.cs_n[1] and self.sck[1] == 1 and self.sck[2] == 0

    @property
    def falls(self) -> bool:
        """True if the slave shifts out the next bit after this clock."""
        return self.active and not self.cs_n[1] and self.sck[1] == 0 and self.sck[2] == 1

    @property
    def last(self) -> bool:
        """True if the next bit completes a word or a command."""
        return self.count == (WORD_BITS if self.in_data else COMMAND_BITS) - 1

    @property
    def received(self) -> int:
        """The last 32 bits received, including the bit of this clock."""
        return (self.shift << 1 | self.mosi[1]) & (1 << WORD_BITS) - 1

    @property
    def write(self) -> Write | None:
        """The register write completed in this clock, or None."""
        complete = self.rises and self.last and self.in_data and self.writes
        return Write(self.address, self.received) if complete else None

    @property
    def miso(self) -> int:
        """Level of MISO; 0 except during the words of a read."""
        return self.shift >> WORD_BITS - 1 if self.in_data and not self.writes else 0

    def clock(self, pins: Pins, read_data: int = 0) -> None:
        """Apply a rising edge with the levels of the pins and the register word at ``address``."""
        if self.rises:
            if self.last:
                if self.in_data:
                    self.address = (self.address + WORD_BYTES) % (1 << ADDRESS_BITS)
                else:
                    self.address = self.received & (1 << ADDRESS_BITS) - 1
                    self.writes = bool(self.received >> ADDRESS_BITS & 1)
                self.in_data, self.count = True, 0
            else:
                self.count += 1
            self.bit = self.mosi[1]
        elif self.falls:
            loads = self.in_data and not self.writes and self.count == 0
            self.shift = read_data if loads else (self.shift << 1 | self.bit) & (1 << WORD_BITS) - 1
        elif self.cs_n[1:] == [0, 1, 1]:
            self.in_data, self.count = False, 0
        self.active = (self.active or self.cs_n[2:] == [1, 1]) and not self.cs_n[1]
        self.sck = [pins.sck, *self.sck[:2]]
        self.cs_n = [pins.cs_n, *self.cs_n[:3]]
        self.mosi = [pins.mosi, self.mosi[0]]


def command(address: int, write: bool) -> int:
    """Return the command word of a transfer."""
    return int(write) << ADDRESS_BITS | address


def bits(value: int, count: int) -> Iterator[int]:
    """Yield the bits of a number, most significant first."""
    return (value >> place & 1 for place in reversed(range(count)))


def transfer(address: int, words: Iterable[int], write: bool) -> list[int]:
    """Return the bits that a host sends in a transfer: a command, then words."""
    sent = list(bits(command(address, write), COMMAND_BITS))
    for word in words:
        sent += bits(word, WORD_BITS)
    return sent
