"""SPI slave: mode 0, sampled by the clock of the readout."""

from typing import Any

from amaranth.hdl import Cat, Const, Module, Mux, Signal
from amaranth.lib.wiring import In, Out

from eskin.model.config import ReadoutConfig
from eskin.model.registers.description import WORD_BITS, WORD_BYTES
from eskin.model.registers.spi import ADDRESS_BITS, COMMAND_BITS, HIGH_CLOCKS, LOW_CLOCKS_TO_READ
from eskin.rtl.block import Block

PINS = {"spi_sck": In(1), "spi_cs_n": In(1), "spi_mosi": In(1), "spi_miso": Out(1), "spi_miso_enable": Out(1)}
"""The pins, as ports of whatever has them."""

HOST = f"""\
  // A host at the SPI pins.
  reg [{COMMAND_BITS + WORD_BITS - 1}:0] sent;
  integer place;
  task static transfer(input logic write, input logic [{ADDRESS_BITS - 1}:0] address,
                       input logic [{WORD_BITS - 1}:0] data);
    begin
      sent = {{write, address, data}};
      repeat (6) @(negedge clk);
      spi_cs_n = 1'b0;
      repeat (4) @(negedge clk);
      for (place = {COMMAND_BITS + WORD_BITS - 1}; place >= 0; place = place - 1) begin
        spi_mosi = sent[place];
        repeat ({LOW_CLOCKS_TO_READ}) @(negedge clk);
        word = {{word[{WORD_BITS - 2}:0], spi_miso_enable ? spi_miso : 1'bx}};
        spi_sck = 1'b1;
        repeat ({HIGH_CLOCKS}) @(negedge clk);
        spi_sck = 1'b0;
      end
      repeat (4) @(negedge clk);
      spi_cs_n = 1'b1;
    end
  endtask
"""
"""Host of the delivered testbench: a task for one transfer, which leaves what it reads in ``word``."""


class SpiSlave(Block[ReadoutConfig]):
    """SPI slave with the protocol {write, 15-bit address}, then 32-bit words at rising addresses.

    The only clock is that of the readout: SCK, CS and MOSI pass two flops each, and edges of SCK are found behind them.
    So SCK must stay high for two clocks and low for two clocks, or four if the host reads: MISO follows the fall of SCK
    by at most three clocks. A transfer begins when CS falls after at least two clocks of high. Any clock in which CS is
    seen high ends the transfer; after a shorter pulse the rest of the transfer is ignored. While CS is high only the
    synchronisers are clocked.

    Attributes
    ----------
    spi_sck, spi_cs_n, spi_mosi : In(1)
        From the host, asynchronous.
    spi_miso, spi_miso_enable : Out(1)
        To the host; enable opens the pad during a transfer.
    address : Out(15)
        Address of the word that is written, or read next.
    write, write_data : Out(1), Out(32)
        The word is written at the end of this clock.
    read_data : In(32)
        The word at ``address``, taken as a whole in one clock.
    """

    module_name = "eskin_spi"
    address_bits, word_bits = ADDRESS_BITS, WORD_BITS

    def __init__(self, config: ReadoutConfig) -> None:
        word = self.word_bits
        bus = {"address": Out(self.address_bits), "write": Out(1), "write_data": Out(word), "read_data": In(word)}
        super().__init__(config, PINS | bus)

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        # Bit 0 is the newest level. After reset CS counts as low without a transfer: no transfer begins until CS has
        # been seen high.
        sck, cs_n, mosi = Signal(3, name="sck"), Signal(4, name="cs_n"), Signal(2, name="mosi")
        m.d.sync += [
            sck.eq(Cat(self.spi_sck, sck[:2])),
            cs_n.eq(Cat(self.spi_cs_n, cs_n[:3])),
            mosi.eq(Cat(self.spi_mosi, mosi[:1])),
        ]
        active, starts, rises, falls = (Signal(name=name) for name in ("active", "starts", "rises", "falls"))
        m.d.comb += [
            starts.eq(cs_n[1:] == 0b110),
            rises.eq(active & ~cs_n[1] & sck[1] & ~sck[2]),
            falls.eq(active & ~cs_n[1] & ~sck[1] & sck[2]),
        ]
        with m.If(starts):
            m.d.sync += active.eq(1)
        with m.Elif(active & cs_n[1]):
            m.d.sync += active.eq(0)

        word_bits, command_bits = self.word_bits, 1 + self.address_bits
        count = Signal(range(max(word_bits, command_bits)))
        in_data, writes, bit = (Signal(name=name) for name in ("in_data", "writes", "bit_in"))
        last = Signal()
        m.d.comb += last.eq(count == Mux(in_data, word_bits - 1, command_bits - 1))
        with m.If(starts):
            m.d.sync += [count.eq(0), in_data.eq(0)]
        with m.Elif(rises):
            m.d.sync += [count.eq(Mux(last, 0, (count + 1)[: len(count)])), in_data.eq(in_data | last), bit.eq(mosi[1])]

        shift, address = (
            Signal(max(word_bits, command_bits), name="shift"),
            Signal(self.address_bits, name="word_address"),
        )
        received = Cat(mosi[1], shift[:-1])
        with m.If(rises & last):
            with m.If(in_data):
                m.d.sync += address.eq((address + WORD_BYTES)[: self.address_bits])
            with m.Else():
                m.d.sync += [address.eq(received[: self.address_bits]), writes.eq(received[self.address_bits])]
        reads = Signal()
        m.d.comb += reads.eq(in_data & ~writes)
        with m.If(falls):
            m.d.sync += shift.eq(Mux(reads & (count == Const(0)), self.read_data, Cat(bit, shift[:-1])))
        m.d.comb += [
            self.address.eq(address),
            self.write.eq(rises & last & in_data & writes),
            self.write_data.eq(received[:word_bits]),
            self.spi_miso.eq(shift[word_bits - 1] & reads),
            self.spi_miso_enable.eq(active),
        ]
        return m


class NarrowSlave(SpiSlave):
    """SPI slave with short addresses and words, so that bounded proofs reach the end of a transfer."""

    address_bits, word_bits = 3, 3


class ShortSlave(SpiSlave):
    """SPI slave whose addresses reach the masks of a small array."""

    address_bits, word_bits = 7, 3
