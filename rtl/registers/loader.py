"""Serial loader: samples of all taxels over SPI, for a chip with few pins."""

from typing import Any

from amaranth.hdl import Cat, Module, Signal
from amaranth.lib.wiring import In, Out

from eskin.model.config import ReadoutConfig
from eskin.rtl.block import Block


class SampleLoader(Block[ReadoutConfig]):
    """Loader that receives a frame of samples and presents all of them in one clock.

    SPI mode 0, sampled by the clock: SCK must stay high for two clocks and low for two. A frame is one transfer of
    ``taxels * W`` bits: taxel 0 first, the most significant bit first. The end of a transfer of any other length
    changes nothing but ``refused``.

    Attributes
    ----------
    sck, cs_n, mosi : In(1)
        From the host, asynchronous.
    sample : Out(taxels * W)
        All samples, taxel 0 in the least significant bits.
    sample_valid : Out(1)
        They are a frame; for one clock, the third after CS is seen high.
    refused : Out(1)
        The last transfer had another length.
    """

    module_name = "eskin_loader"

    def __init__(self, config: ReadoutConfig) -> None:
        self.bits = config.taxels * config.sample_bits
        serial = {"sck": In(1), "cs_n": In(1), "mosi": In(1)}
        super().__init__(config, {**serial, "sample": Out(self.bits), "sample_valid": Out(1), "refused": Out(1)})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        # Bit 0 is the newest level. After reset CS counts as low, in a transfer that cannot become a frame.
        sck, cs_n, mosi = Signal(3, name="sck_flops"), Signal(3, name="cs_flops"), Signal(2, name="mosi_flops")
        m.d.sync += [
            sck.eq(Cat(self.sck, sck[:2])),
            cs_n.eq(Cat(self.cs_n, cs_n[:2])),
            mosi.eq(Cat(self.mosi, mosi[:1])),
        ]
        starts, ends, rises, full = (Signal(name=name) for name in ("starts", "ends", "rises", "full"))
        count = Signal(range(self.bits + 2), init=self.bits + 1)
        m.d.comb += [
            starts.eq(~cs_n[1] & cs_n[2]),
            ends.eq(cs_n[1] & ~cs_n[2]),
            rises.eq(~cs_n[1] & sck[1] & ~sck[2]),
            full.eq(count == self.bits),
            self.sample_valid.eq(ends & full),
        ]
        chain = Signal(self.bits)
        with m.If(starts):
            m.d.sync += count.eq(0)
        with m.Elif(rises):
            m.d.sync += chain.eq(Cat(mosi[1], chain[:-1]))
            with m.If(count <= self.bits):
                m.d.sync += count.eq((count + 1)[: len(count)])
        refused = Signal()
        with m.If(ends):
            m.d.sync += refused.eq(~full)
        m.d.comb += self.refused.eq(refused)
        # The first sample has moved furthest.
        width, taxels = self.config.sample_bits, self.config.taxels
        m.d.comb += self.sample.eq(Cat(chain.word_select(taxels - 1 - index, width) for index in range(taxels)))
        return m
