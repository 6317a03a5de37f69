"""The readout with ``amaranth.lib.stream`` interfaces, for designs written in Amaranth."""

from typing import Any

from amaranth.hdl import Cat, Module, signed, unsigned
from amaranth.lib import data, stream, wiring
from amaranth.lib.wiring import In, Out

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.links.stream import Stream
from eskin.rtl.arbiter import event_ports
from eskin.rtl.readout import Readout

ADDRESS = ("event_col", "event_row", "event_polarity")
"""Ports of an address event, the lowest bits first."""


class StreamReadout(wiring.Component):
    """``Readout`` with streams for samples and events.

    Attributes
    ----------
    samples : In(stream of ArrayLayout(signed(W), rows * columns))
        Codes of all taxels, one transfer per sample tick; ``ready`` is always 1.
    events : Out(stream of StructLayout)
        Address events with the fields ``col``, ``row`` and ``polarity`` (1 for ON). A field that would have no bit is
        absent, as are the columns of an array with one column and the polarity of N-LCS.
    taxel_enable : In(rows * columns)
        Mask: 0 silences a taxel. All taxels are enabled where nothing drives it.
    spi_sck, spi_cs_n, spi_mosi, spi_miso, spi_miso_enable
        As ``Readout`` has them (``registers="spi"``).
    """

    _MustUse__silence = True  # Amaranth's warning about a refused configuration would hide the error

    def __init__(self, config: ReadoutConfig) -> None:
        if config.frontend != "digital":
            raise InputError(f"a sample stream needs frontend 'digital', not {config.frontend!r}")
        if not config.protocol.streams:
            raise InputError(f"an event stream needs link {Stream.name!r}, not {config.link!r}")
        self.config = config
        self.readout = Readout(config)
        ports = self.readout.signature.members
        widths = {name: len(getattr(self.readout, name)) for name in ADDRESS if name in ports}
        fields = {name.removeprefix("event_"): unsigned(width) for name, width in widths.items()}
        samples = data.ArrayLayout(signed(config.sample_bits), config.taxels)
        own: dict[str, Any] = {
            "samples": In(stream.Signature(samples)),
            "events": Out(stream.Signature(data.StructLayout(fields))),
            "taxel_enable": In(config.taxels, init=(1 << config.taxels) - 1),
        }
        inside = {"sample", "sample_valid", *event_ports(config, Out)}
        self._same = [name for name in ports if name not in inside and name not in own]
        super().__init__(own | {name: ports[name] for name in self._same})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        m.submodules.readout = readout = self.readout
        address = [getattr(readout, name) for name in ADDRESS if name in readout.signature.members]
        m.d.comb += [
            readout.sample.eq(self.samples.payload.as_value()),
            readout.sample_valid.eq(self.samples.valid),
            self.samples.ready.eq(1),
            readout.taxel_enable.eq(self.taxel_enable),
            self.events.payload.as_value().eq(Cat(address)),
            self.events.valid.eq(readout.event_valid),
            readout.event_ready.eq(self.events.ready),
        ]
        readout.connect_all(m, self, self._same)
        return m
