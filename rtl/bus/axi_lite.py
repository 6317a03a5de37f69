"""AXI4-Lite access to the registers of a readout, which keeps its SPI slave."""

from typing import Any

from amaranth.hdl import Cat, Const, Module, Mux, Signal
from amaranth.lib.wiring import In, Out

from eskin.model.bus.axi_lite import BUS_ADDRESS_BITS, CLOCKS_PER_BIT
from eskin.model.config import ReadoutConfig
from eskin.model.registers.description import WORD_BITS
from eskin.model.registers.spi import ADDRESS_BITS
from eskin.rtl.block import Block
from eskin.rtl.registers.spi import PINS

HOST = """\
  // A processor at the bus.
  task static transfer(input logic write, input logic [14:0] address, input logic [31:0] data);
    begin
      s_axi_awaddr = address[11:0];
      s_axi_araddr = address[11:0];
      s_axi_wdata = data;
      s_axi_wstrb = 4'hf;
      s_axi_awvalid = write;
      s_axi_wvalid = write;
      s_axi_arvalid = !write;
      while ((write ? s_axi_awready && s_axi_wready : s_axi_arready) !== 1'b1) @(negedge aclk);
      @(negedge aclk);
      s_axi_awvalid = 1'b0;
      s_axi_wvalid = 1'b0;
      s_axi_arvalid = 1'b0;
      s_axi_bready = write;
      s_axi_rready = !write;
      while ((write ? s_axi_bvalid : s_axi_rvalid) !== 1'b1) @(negedge aclk);
      word = s_axi_rdata;
      if ((write ? s_axi_bresp : s_axi_rresp) !== 2'b00) fail("an error response");
      @(negedge aclk);
      s_axi_bready = 1'b0;
      s_axi_rready = 1'b0;
    end
  endtask
"""
"""Host of the delivered testbench: a task for one access, which leaves what it reads in ``word``."""


def lite_ports(address_bits: int = BUS_ADDRESS_BITS, word_bits: int = WORD_BITS) -> dict[str, Any]:
    """Return the ports of the bus; ``AWPROT`` and ``ARPROT`` have no effect."""
    strobes = -(-word_bits // 8)
    return {
        **{"s_axi_awaddr": In(address_bits), "s_axi_awprot": In(3), "s_axi_awvalid": In(1), "s_axi_awready": Out(1)},
        **{"s_axi_wdata": In(word_bits), "s_axi_wstrb": In(strobes), "s_axi_wvalid": In(1), "s_axi_wready": Out(1)},
        **{"s_axi_bresp": Out(2), "s_axi_bvalid": Out(1), "s_axi_bready": In(1)},
        **{"s_axi_araddr": In(address_bits), "s_axi_arprot": In(3), "s_axi_arvalid": In(1), "s_axi_arready": Out(1)},
        **{"s_axi_rdata": Out(word_bits), "s_axi_rresp": Out(2), "s_axi_rvalid": Out(1), "s_axi_rready": In(1)},
    }


class AxiLite(Block[ReadoutConfig]):
    """AXI4-Lite subordinate that makes an SPI transfer of every access.

    One access at a time; where read and write wait, they take turns. The response comes when the transfer has ended, so
    a write has then taken effect. The lowest two bits of an address are ignored. A write without all byte strobes
    changes nothing and gets SLVERR; every other response is OKAY. All outputs to the bus are registers.

    Attributes
    ----------
    s_axi_* : In and Out
        The bus.
    spi_sck, spi_cs_n, spi_mosi, spi_miso
        The pins of the readout's SPI slave, from the side of the host.
    """

    module_name = "eskin_axi_lite"
    bus_address_bits, address_bits, word_bits = BUS_ADDRESS_BITS, ADDRESS_BITS, WORD_BITS

    def __init__(self, config: ReadoutConfig) -> None:
        turned = {name: (In if port.flow is Out else Out)(1) for name, port in PINS.items()}
        del turned["spi_miso_enable"]
        super().__init__(config, {**lite_ports(self.bus_address_bits, self.word_bits), **turned})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        takes_write, takes_read, busy = (Signal(name=name) for name in ("takes_write", "takes_read", "busy"))
        written, read, refused = (Signal(name=name) for name in ("write_done", "read_done", "refused"))
        writes = Signal(name="writes")
        m.d.comb += [
            self.s_axi_awready.eq(takes_write),
            self.s_axi_wready.eq(takes_write),
            self.s_axi_arready.eq(takes_read),
            self.s_axi_bvalid.eq(written),
            self.s_axi_bresp.eq(Cat(Const(0, 1), refused)),
            self.s_axi_rvalid.eq(read),
        ]
        idle = Signal()
        m.d.comb += idle.eq(~Cat(takes_write, takes_read, busy, written, read).any())
        asks = self.s_axi_awvalid & self.s_axi_wvalid
        with m.If(idle):
            m.d.sync += [
                takes_write.eq(asks & ~(self.s_axi_arvalid & writes)),
                takes_read.eq(self.s_axi_arvalid & ~(asks & ~writes)),
            ]
        with m.Else():
            m.d.sync += [takes_write.eq(0), takes_read.eq(0)]
        with m.If(written & self.s_axi_bready):
            m.d.sync += written.eq(0)
        with m.If(read & self.s_axi_rready):
            m.d.sync += read.eq(0)
        whole = self.s_axi_wstrb.all()
        with m.If(takes_write):
            m.d.sync += [refused.eq(~whole), written.eq(~whole)]
        with m.If(takes_write | takes_read):
            m.d.sync += writes.eq(takes_write)
        self._transfer(m, busy, (takes_write & whole) | takes_read, takes_write, writes, (written, read))
        return m

    def _transfer(
        self, m: Module, busy: Signal, starts: Any, takes_write: Signal, writes: Signal, done: tuple[Signal, Signal]
    ) -> None:
        """Add the host of the SPI slave; it raises one of the two signals ``done`` after a write or a read."""
        command_bits, clocks = 1 + self.address_bits, CLOCKS_PER_BIT
        clock = Signal(range(clocks), name="clock_of_bit")
        count = Signal(range(command_bits + self.word_bits), name="bit_count")
        place = Signal(self.bus_address_bits - 2, name="word_address")
        data = Signal(self.word_bits, name="data")
        last_clock, last_bit = clock == clocks - 1, count == command_bits + self.word_bits - 1
        in_data = Signal(name="in_data")
        with m.If(starts):
            m.d.sync += [
                busy.eq(1),
                place.eq(Mux(takes_write, self.s_axi_awaddr[2:], self.s_axi_araddr[2:])),
                data.eq(self.s_axi_wdata & takes_write.replicate(self.word_bits)),
            ]
        with m.Elif(busy):
            m.d.sync += clock.eq((clock + 1)[: len(clock)])
            with m.If(last_clock):
                m.d.sync += count.eq(Mux(last_bit, 0, count + 1))
            with m.If(last_clock & in_data):
                m.d.sync += data.eq(Cat(self.spi_miso, data[:-1]))
            with m.If(last_clock & last_bit):
                m.d.sync += [busy.eq(0), done[0].eq(writes), done[1].eq(~writes)]
        # The command in the order of transmission, by the number of the bit: the other bits of the address are 0.
        command = {0: writes} | {command_bits - 3 - index: bit for index, bit in enumerate(place)}
        m.d.comb += [
            in_data.eq(count >= command_bits),
            self.spi_cs_n.eq(~busy),
            self.spi_sck.eq(clock[-1]),
            self.spi_mosi.eq((data[-1] & in_data) | Cat((count == n) & bit for n, bit in command.items()).any()),
            self.s_axi_rdata.eq(data),
        ]


class NarrowLite(AxiLite):
    """AXI4-Lite subordinate with short addresses and words, so that bounded proofs reach the end of an access."""

    bus_address_bits, address_bits, word_bits = 3, 3, 3
