"""The readout behind AXI."""

from typing import Any

from amaranth.hdl import ClockDomain, Module
from amaranth.lib.wiring import In, Out

from eskin.model.bus.config import BusConfig
from eskin.rtl.arbiter import event_ports
from eskin.rtl.block import Block
from eskin.rtl.bus.axi_lite import AxiLite, lite_ports
from eskin.rtl.bus.axi_stream import AxiStream, stream_ports
from eskin.rtl.readout import Readout
from eskin.rtl.registers.spi import PINS


class AxiReadout(Block[BusConfig]):
    """Top module with a readout, the AXI4-Stream of its events, and the AXI4-Lite of its registers.

    Attributes
    ----------
    aclk, aresetn : In(1)
        Clock and active-low reset of the bus, which are those of the readout.
    m_axis_*
        See ``AxiStream``.
    s_axi_*
        See ``AxiLite`` (``registers="spi"``).
    others
        Those of ``Readout``.
    """

    module_name = "eskin_axi"

    def __init__(self, config: BusConfig) -> None:
        readout = Readout(config.readout).signature.members
        self.events = [*event_ports(config.readout, Out)]
        self.same = [name for name in readout if name not in (*self.events, *PINS)]
        self.has_registers = config.readout.registers != "none"
        ports: dict[str, Any] = {"aclk": In(1), "aresetn": In(1)}
        ports |= {name: readout[name] for name in self.same} | stream_ports(config)
        super().__init__(config, ports | (lite_ports() if self.has_registers else {}))

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        m.domains.sync = domain = ClockDomain(local=True, async_reset=self.config.reset == "async")
        m.d.comb += [domain.clk.eq(self.aclk), domain.rst.eq(~self.aresetn)]
        readout, stream = Readout(self.config.readout), AxiStream(self.config)
        readout.place(m, "readout", platform)
        stream.place(m, "stream", platform)
        readout.connect_all(m, self, self.same)
        stream.connect_all(m, readout, self.events)
        stream.connect_all(m, self, stream_ports(self.config))
        if self.has_registers:
            lite = AxiLite(self.config.readout)
            lite.place(m, "lite", platform)
            lite.connect_all(m, self, lite_ports())
            lite.connect_all(m, readout, [name for name in PINS if name in lite.signature.members])
        return m
