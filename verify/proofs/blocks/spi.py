"""Properties of the SPI slave: only complete transfers write, and reads return the addressed word."""

from typing import Any, ClassVar

from amaranth.hdl import Cat, Const, Module, Mux, Signal, Value

from eskin.model.config import ReadoutConfig
from eskin.model.registers.description import WORD_BYTES
from eskin.rtl.registers.spi import NarrowSlave, SpiSlave
from eskin.verify.proofs.checker import Checker, Promises, before, implies


class Transfers:
    """SPI transfers, decoded from the pins.

    ``complete`` is high with the last bit of a word of a write transfer, whose ``address`` and ``word`` are then valid.
    ``in_data`` is high once the command is complete, and ``reads`` if the command reads.
    """

    def __init__(self, m: Module, pins: Any, slave: type[SpiSlave]) -> None:
        address_bits, self.word_bits = slave.address_bits, slave.word_bits
        command_bits, whole_bits = 1 + address_bits, 1 + address_bits + self.word_bits
        sck = _past(m, pins.spi_sck, "sck", 3)
        cs_n = _past(m, pins.spi_cs_n, "cs_n", 4)
        mosi = _past(m, pins.spi_mosi, "mosi", 2)
        self.under_way, self.closed = Signal(name="under_way"), cs_n[1]
        opens = ~cs_n[1] & cs_n[2] & cs_n[3]
        m.d.sync += self.under_way.eq(opens | (self.under_way & ~cs_n[1]))
        unbroken = self.under_way & ~cs_n[1]
        self.rise, self.fall = unbroken & sck[1] & ~sck[2], unbroken & ~sck[1] & sck[2]

        # Bits of the command and the word so far, and all that was sent, taken with every rise.
        bits, sent, writes = Signal(range(whole_bits)), Signal(max(self.word_bits, command_bits)), Signal()
        whole, now = bits == whole_bits - 1, Cat(mosi[1], sent[:-1])
        with m.If(opens):
            m.d.sync += bits.eq(0)
        with m.Elif(self.rise):
            m.d.sync += [bits.eq(Mux(whole, command_bits, bits + 1)), sent.eq(now)]
        self.address = Signal(address_bits, name="address_sent")
        with m.If(self.rise & (bits == command_bits - 1)):
            m.d.sync += [self.address.eq(now), writes.eq(now[address_bits])]
        with m.Elif(self.rise & whole):
            m.d.sync += self.address.eq(self.address + WORD_BYTES)
        self.complete, self.word = self.rise & whole & writes, now[: self.word_bits]
        self.in_data, self.first = bits >= command_bits, bits == command_bits
        self.reads = self.in_data & ~writes

    def shown(self, m: Module, word: Value) -> Value:
        """Return the bit of a word that MISO must show; the slave copies the word before its first bit."""
        kept, moves = Signal(self.word_bits, name="kept"), self.fall & self.reads
        return Checker.keep(m, kept, moves & self.first, moves, Cat(Const(0, 1), kept[:-1]), start=word)[-1]


def _past(m: Module, pin: Value, name: str, clocks: int) -> list[Signal]:
    """Return the values of a pin one clock ago, two clocks ago, and so on."""
    found: list[Any] = []
    for clock in range(clocks):
        found.append(before(m, found[-1] if found else pin, f"{name}_{clock}"))
    return found


class SpiChecker(Checker[ReadoutConfig]):
    """Checker of the SPI slave; pins and data are free."""

    block: ClassVar[type[SpiSlave]] = SpiSlave

    def check(self, m: Module) -> Promises:
        sent = Transfers(m, self, self.block)
        complete = sent.complete
        yield "aborted_writes_nothing", implies(self.write, complete), self.write
        yield "whole_is_written", implies(complete, self.write), complete
        yield "written_as_sent", implies(self.write, self.write_data == sent.word), self.write & sent.word[0]
        same = implies(sent.in_data, self.address == sent.address)
        yield "address_as_sent", same, self.write & (sent.address != 0)
        kept = sent.shown(m, self.read_data)
        yield "read_as_kept", implies(sent.reads & sent.rise, self.spi_miso == kept), sent.reads & kept
        yield "quiet_otherwise", implies(~sent.reads, ~self.spi_miso), ~sent.reads & sent.rise
        closes = sent.under_way & sent.closed
        yield "opens_after_two", self.spi_miso_enable == sent.under_way, closes


class NarrowSpiChecker(SpiChecker):
    """Checker of the SPI slave with short addresses and words."""

    block = NarrowSlave
