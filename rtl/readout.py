"""The readout: taxel array, arbiter and link."""

from typing import Any

from amaranth.hdl import Cat, Module, Mux, Signal, unsigned
from amaranth.lib.wiring import In, Out

from eskin.model.config import ReadoutConfig
from eskin.model.decay import decay_phases
from eskin.model.encoders.fields import SETTABLE, is_off
from eskin.rtl.arbiter import Arbiter, event_ports
from eskin.rtl.block import Block, numbered
from eskin.rtl.decay import DecayTicks
from eskin.rtl.encoders.fields import Fields
from eskin.rtl.links import registry as links
from eskin.rtl.logic import or_tree
from eskin.rtl.registers.decay import SettableDecayTicks
from eskin.rtl.registers.host import Host, selects
from eskin.rtl.registers.spi import PINS
from eskin.rtl.taxel import Row, settings


class Readout(Block[ReadoutConfig]):
    """Top module of the readout; taxel (r, c) has index r * columns + c.

    Attributes
    ----------
    taxel_enable : In(rows * columns)
        Mask: 0 silences a taxel.
    sample, sample_valid : In(rows * columns * W), In(1)
        Codes of all taxels, taken together (digital front end); ``Fields`` adds them to receptive fields. The analog
        front end has only ``sample_valid``, the sample tick.
    above, below, compare, reference_code, half_width
        Comparator decisions in, their strobes, references and half-widths out (analog front end), see ``Taxel``.
    event_valid, event_ready, event_row, event_col, event_polarity; or aer_req, aer_ack, aer_addr
        Address events, at the ports of the link (``eskin.rtl.links``).
    spi_sck, spi_cs_n, spi_mosi, spi_miso, spi_miso_enable
        Settings at run time (``registers="spi"``), see ``eskin.rtl.registers``.
    step_code : Out(half_width_bits)
        D in codes, a register, for the comparators (analog front end with registers and without half_width).
    field_select : Out(3 * rows * columns)
        {both, neighbours, own} of every taxel, for the multiplexer of its sensor: registers, one-hot, or 0 if the
        taxel is off (``receptive_fields="settable"`` with the analog front end).
    """

    module_name = "eskin_readout"

    def __init__(self, config: ReadoutConfig) -> None:
        row = Row(config)
        self.per_row = ["enable", *row.per_taxel]
        ports: dict[str, Any] = {"taxel_enable": In(config.taxels), "sample_valid": In(1)}
        for name in row.per_taxel:
            flow = In if row.signature.members[name].flow is In else Out
            ports[name] = flow(unsigned(config.rows * len(getattr(row, name))))
        ports |= links.named(config.link).ports(config)
        if config.registers == "spi":
            ports |= PINS | ({"step_code": Out(config.half_width_bits)} if _shows_step(config) else {})
            ports |= {"field_select": Out(3 * config.taxels)} if selects(config) else {}
        super().__init__(config, ports)

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        config = self.config
        arbiter = Arbiter(config)
        arbiter.place(m, "arbiter", platform)
        host = self._host(m, arbiter, platform)
        enable = self.taxel_enable if host is None else host.enabled
        if is_off(config).any():
            enable = Cat(0 if off else enable[taxel] for taxel, off in enumerate(is_off(config)))
        outer = {name: getattr(self, name) for name in self.per_row[1:]} | {"enable": enable}
        if config.receptive_fields != "own" and config.frontend == "digital":
            fields = Fields(config)
            fields.place(m, "fields", platform)
            m.d.comb += fields.sample.eq(self.sample)
            if host is not None and config.receptive_fields == SETTABLE:
                m.d.comb += fields.choice.eq(host.choice)
            outer["sample"] = fields.signal

        needs_clock: list[Any] = [arbiter.awake]
        tick = Signal()
        if config.encoder.leaks or "tick" in Row(config).signature.members:
            m.d.sync += tick.eq(self.sample_valid)
            needs_clock += [self.sample_valid, tick]
        if host is not None and config.encoder.leaks:
            needs_clock.append(host.decay_restart)
        if config.encoder.leaks:
            row_decay = self._row_decay(m, tick, host, platform)

        for index in range(config.rows):
            row = Row(config)
            row.place(m, numbered("row", index, config.rows), platform)
            m.d.comb += [row.select.eq(arbiter.select[index]), row.granted.eq(arbiter.granted[index])]
            needs_clock.append(row.awake)
            _request(m, arbiter, row, host, index)
            if "tick" in row.signature.members:
                m.d.comb += row.tick.eq(tick)
            if config.encoder.leaks:
                m.d.comb += row.decay.eq(row_decay[index])
            if config.frontend == "digital":
                m.d.comb += row.sample_valid.eq(self.sample_valid)
            else:
                wrote = host.wrote if host is not None and config.asks_between_ticks else 0
                m.d.comb += row.ask.eq(self.sample_valid | wrote)
            if host is not None:
                m.d.comb += [getattr(row, name).eq(host.setting(name)) for name in settings(config)]
            for name in self.per_row:
                row.connect(m, name, outer[name].word_select(index, len(getattr(row, name))))

        # No logic in this block uses the signal. A clock gate may stop all but link and host, which hear ACK and SPI.
        awake = Signal(attrs={"keep": 1})
        m.d.comb += awake.eq(or_tree(needs_clock))

        sink: Any = self
        link = links.named(config.link)
        if link.block is not None:
            sink = link.block(config)
            sink.place(m, "link", platform)
            sink.connect_all(m, self, link.ports(config))
        arbiter.connect_all(m, sink, event_ports(config, Out))
        return m

    def _host(self, m: Module, arbiter: Arbiter, platform: Any) -> Host | None:
        """Add the SPI host interface if the readout has registers."""
        if self.config.registers == "none":
            return None
        host = Host(self.config)
        host.place(m, "host", platform)
        host.connect_all(m, self, PINS)
        m.d.comb += [
            host.taxel_enable.eq(self.taxel_enable),
            host.event_valid.eq(arbiter.event_valid),
            host.event_ready.eq(arbiter.event_ready),
            host.granted.eq(arbiter.granted),
        ]
        if _shows_step(self.config):
            m.d.comb += self.step_code.eq(host.step << (self.config.step - 1).bit_length())
        if selects(self.config):
            m.d.comb += self.field_select.eq(host.field_select)
        return host

    def _row_decay(self, m: Module, tick: Signal, host: Host | None, platform: Any) -> list[Any]:
        """Return the decay tick of every row."""
        config = self.config
        if host is not None:
            settable = SettableDecayTicks(config)
            settable.place(m, "ticks", platform)
            m.d.comb += [
                settable.tick.eq(tick),
                settable.period.eq(host.decay_period),
                settable.restart.eq(host.decay_restart),
            ]
            return [*settable.decay]
        if config.leak_period == 1:
            return [tick] * config.rows
        decay = DecayTicks(config)
        decay.place(m, "decay_ticks", platform)
        m.d.comb += decay.tick.eq(tick)
        return [decay.decay[decay.phases.index(phase)] for phase in decay_phases(config)]


def _shows_step(config: ReadoutConfig) -> bool:
    """Return True if external comparators need D because no half-width port exists."""
    return config.registers != "none" and config.frontend == "analog" and not config.closes


def _request(m: Module, arbiter: Arbiter, row: Row, host: Host | None, index: int) -> None:
    """Connect the arbiter to the requests of a row, or of the test pattern generator."""
    config = arbiter.config
    request, columns = row.request, row.column_request
    if host is not None:
        request = request | host.row_request[index]
        columns = columns | (host.column_request & (row.select & host.row_request[index]).replicate(config.columns))
    m.d.comb += [
        arbiter.row_request[index].eq(request),
        arbiter.column_request.word_select(index, config.columns).eq(columns),
    ]
    if config.has_polarity:
        polarity = row.column_polarity
        if host is not None:  # the polarity of a masked taxel is arbitrary
            tested = host.column_polarity & row.select.replicate(config.columns)
            polarity = Mux(host.row_request[index], tested, polarity)
        m.d.comb += arbiter.column_polarity.word_select(index, config.columns).eq(polarity)
