"""Properties of the SPI slave: only complete transfers write, and reads return the addressed word."""

from __future__ import annotations

from typing import Any, ClassVar

from amaranth.hdl import Cat, Const, Module, Mux, Signal, Value

from eskin.model.config import ReadoutConfig
from eskin.model.registers.description import WORD_BYTES
from eskin.rtl.registers.spi import NarrowSlave, SpiSlave
from eskin.verify.proofs.checker import Checker, Property, before, implies


class SpiChecker(Checker[ReadoutConfig]):
    """Checker of the SPI slave; pins and data are free."""

    block: ClassVar[type[SpiSlave]] = SpiSlave
    properties = (
        Property(
            "aborted_writes_nothing",
            "a word is written only with its last bit, in a write transfer that CS did not interrupt",
        ),
        Property("whole_is_written", "every complete word of a write transfer is written with its last bit"),
        Property("written_as_sent", "the written word has the sent bits"),
        Property("address_as_sent", "its address is the command's address plus the number of words before it"),
        Property("read_as_kept", "MISO sends the word that the address held before the word's first bit"),
        Property("quiet_otherwise", "MISO is 0 except during the words of a read transfer"),
        Property(
            "opens_after_two", "a transfer lasts from CS low, after two clocks of CS high, until CS is sampled high"
        ),
    )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        address_bits, word_bits = self.block.address_bits, self.block.word_bits
        command_bits, whole_bits = 1 + address_bits, 1 + address_bits + word_bits
        sck = self._past(m, self.spi_sck, "sck", 3)
        cs_n = self._past(m, self.spi_cs_n, "cs_n", 4)
        mosi = self._past(m, self.spi_mosi, "mosi", 2)
        under_way = Signal()
        opens = ~cs_n[1] & cs_n[2] & cs_n[3]
        m.d.sync += under_way.eq(opens | (under_way & ~cs_n[1]))
        unbroken = under_way & ~cs_n[1]
        rise, fall = Signal(), Signal()
        m.d.comb += [rise.eq(unbroken & sck[1] & ~sck[2]), fall.eq(unbroken & ~sck[1] & sck[2])]

        # Bits of the command and the word so far, and all that was sent, taken with every rise.
        bits, sent, writes = Signal(range(whole_bits)), Signal(max(word_bits, command_bits)), Signal()
        whole, now = Signal(), Cat(mosi[1], sent[:-1])
        m.d.comb += whole.eq(bits == whole_bits - 1)
        with m.If(opens):
            m.d.sync += bits.eq(0)
        with m.Elif(rise):
            m.d.sync += [bits.eq(Mux(whole, command_bits, bits + 1)), sent.eq(now)]
        address = Signal(address_bits)
        with m.If(rise & (bits == command_bits - 1)):
            m.d.sync += [address.eq(now), writes.eq(now[address_bits])]
        with m.Elif(rise & whole):
            m.d.sync += address.eq(address + WORD_BYTES)

        complete = rise & whole & writes
        self.promise(m, "aborted_writes_nothing", implies(self.write, complete), self.write)
        self.promise(m, "whole_is_written", implies(complete, self.write), complete)
        self.promise(m, "written_as_sent", implies(self.write, self.write_data == now[:word_bits]), self.write & now[0])
        in_data = bits >= command_bits
        self.promise(m, "address_as_sent", implies(in_data, self.address == address), self.write & (address != 0))
        self._reading(m, rise, fall, bits == command_bits, in_data & ~writes)
        self.promise(m, "opens_after_two", self.spi_miso_enable == under_way, under_way & cs_n[1])
        return self.finish(m)

    def _past(self, m: Module, pin: Value, name: str, clocks: int) -> list[Signal]:
        """Return the values of a pin one clock ago, two clocks ago, and so on."""
        found: list[Any] = []
        for clock in range(clocks):
            found.append(before(m, found[-1] if found else pin, f"{name}_{clock}"))
        return found

    def _reading(self, m: Module, rise: Signal, fall: Signal, first: Value, reads: Value) -> None:
        """Check that the slave samples a read word only once, at the falling SCK edge before the first bit."""
        kept = Signal(self.block.word_bits)
        with m.If(fall & reads & first):
            m.d.sync += kept.eq(self.read_data)
        with m.Elif(fall & reads):
            m.d.sync += kept.eq(Cat(Const(0, 1), kept[:-1]))
        shown = rise & reads
        self.promise(m, "read_as_kept", implies(shown, self.spi_miso == kept[-1]), shown & self.spi_miso)
        self.promise(m, "quiet_otherwise", implies(~reads, ~self.spi_miso), ~reads & rise)


class NarrowSpiChecker(SpiChecker):
    """Checker of the SPI slave with short addresses and words."""

    block = NarrowSlave
