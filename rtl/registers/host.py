"""Host interface of a readout: SPI slave, register file and test pattern generator."""

from typing import Any

from amaranth.hdl import Cat, Module, Signal
from amaranth.lib.wiring import In, Out

from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import CHOICES, SETTABLE
from eskin.rtl.block import Block
from eskin.rtl.registers.file import BUS, COUNTS, WRITTEN, RegisterFile, signals
from eskin.rtl.registers.pattern import REGISTER, TestPattern, fields
from eskin.rtl.registers.spi import PINS, ShortSlave, SpiSlave

SETTINGS = ("decay_shift", "decay_period", "window_period")
"""Fields of the register file that go to the array unchanged."""

PATTERN = ("granted", "row_request", "column_request", "column_polarity")
"""Ports of the test pattern generator to arbiter and rows."""


class Host(Block[ReadoutConfig]):
    """Host interface: receives settings over SPI, counts events and stalls, and sends test patterns.

    Attributes
    ----------
    spi_sck, spi_cs_n, spi_mosi, spi_miso, spi_miso_enable
        See ``SpiSlave``.
    taxel_enable, enabled : In(rows * columns), Out(rows * columns)
        The mask from outside, and the mask for the array: 0 during a test pattern and a clear.
    event_valid, event_ready : In(1)
        Handshake of the arbiter, for the counters.
    granted : In(rows)
        The granted row, one-hot.
    row_request, column_request, column_polarity
        Requests of the test pattern, see ``TestPattern``.
    step : Out(resolution)
        D, one-hot in units of the built D; a register, a clock behind the register that the host wrote.
    choice : Out(2 * rows * columns)
        Number of every taxel's field (``receptive_fields="settable"``, digital front end).
    field_select : Out(3 * rows * columns)
        {both, neighbours, own} of every taxel, one-hot or 0; registers, a clock behind the registers that the host
        wrote (analog front end).
    wrote : Out(1)
        A host wrote a register in the clock before, and ``step`` or ``field_select`` may change at the end of this
        clock (analog front end that decides in every clock).
    decay_restart : Out(1)
        The decay ticks restart.
    decay_shift, decay_period, window_period : Out
        Register fields that the encoder has.
    """

    module_name = "eskin_host"

    def __init__(self, config: ReadoutConfig) -> None:
        pattern = TestPattern(config).signature.members
        found = signals(config)
        super().__init__(
            config,
            {
                **PINS,
                "taxel_enable": In(config.taxels),
                "enabled": Out(config.taxels),
                "event_valid": In(1),
                "event_ready": In(1),
                **{name: pattern[name] for name in PATTERN if name in pattern},
                "step": Out(config.resolution),
                "choice": Out(2 * config.taxels) if adds(config) else None,
                "field_select": Out(3 * config.taxels) if selects(config) else None,
                "wrote": Out(1) if config.asks_between_ticks else None,
                "decay_restart": Out(1) if config.encoder.leaks else None,
                **{name: found[name] for name in SETTINGS if name in found},
            },
        )

    def setting(self, name: str) -> Any:
        """Return the settings of the host by port name of a taxel."""
        return self.decay_shift if name == "leak_shift" else getattr(self, name)

    @staticmethod
    def slave() -> type[SpiSlave]:
        """Return the block behind the pins."""
        return SpiSlave

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        config = self.config
        spi, file, pattern = self.slave()(config), RegisterFile(config), TestPattern(config)
        for name, block in (("spi", spi), ("registers", file), ("pattern", pattern)):
            block.place(m, name, platform)
        spi.connect_all(m, self, PINS)
        file.connect_all(m, spi, BUS)

        wrote = Signal()
        if config.asks_between_ticks or selects(config):
            m.d.sync += wrote.eq(spi.write)
        if config.asks_between_ticks:
            m.d.comb += self.wrote.eq(wrote)
        clear, restart = file.control_clear, Signal()
        masks = [getattr(file, name) for name in ("mask_taxels", "mask_rest_taxels") if hasattr(file, name)]
        mask: Any = Cat(masks)
        if config.receptive_fields == SETTABLE:
            mask = mask & self._choose(m, file, wrote)
        m.d.comb += [
            file.clear.eq(clear),
            getattr(file, f"events_count{COUNTS}").eq(self.event_valid & self.event_ready),
            getattr(file, f"stalls_count{COUNTS}").eq(self.event_valid & ~self.event_ready),
            restart.eq(getattr(file, f"{REGISTER}_mode{WRITTEN}") | clear),
            self.enabled.eq(self.taxel_enable & mask & (~pattern.testing & ~clear).replicate(config.taxels)),
            pattern.restart.eq(restart),
            *(getattr(pattern, name).eq(getattr(file, f"{REGISTER}_{name}")) for name in fields(config)),
        ]
        pattern.connect_all(m, self, [name for name in PATTERN if name in self.signature.members])

        step = Signal(config.resolution, init=1, name="step_units")
        with m.If(getattr(file, f"resolution_bits{WRITTEN}")):
            m.d.sync += step.eq(Cat(file.resolution_bits == bits for bits in range(config.resolution, 0, -1)))
        m.d.comb += self.step.eq(step)
        if config.encoder.leaks:
            m.d.comb += self.decay_restart.eq(getattr(file, f"decay_period{WRITTEN}") | clear)
        file.connect_all(m, self, [name for name in SETTINGS if name in self.signature.members])
        return m

    def _choose(self, m: Module, file: RegisterFile, wrote: Signal) -> Any:
        """Connect the fields chosen by the host; return for every taxel whether its field is not off."""
        words = [getattr(file, name) for name in ("fields_taxels", "fields_rest_taxels") if hasattr(file, name)]
        numbers = Signal(2 * self.config.taxels)
        m.d.comb += numbers.eq(Cat(words))
        choices = [numbers[2 * taxel : 2 * taxel + 2] for taxel in range(self.config.taxels)]
        if adds(self.config):
            m.d.comb += self.choice.eq(numbers)
        if selects(self.config):
            # A decoder behind flops may glitch, and two lines together would connect two sensors.
            select = Signal(3 * len(choices), init=sum(1 << 3 * taxel for taxel in range(len(choices))))
            with m.If(wrote):
                m.d.sync += select.eq(Cat(Cat(choice == number for number in range(3)) for choice in choices))
            m.d.comb += self.field_select.eq(select)
        return Cat(choice != CHOICES.index("off") for choice in choices)


class ShortHost(Host):
    """Host interface for proofs, with short addresses and words that reach only the lowest bits of registers."""

    @staticmethod
    def slave() -> type[SpiSlave]:
        return ShortSlave


def adds(config: ReadoutConfig) -> bool:
    """Return True if the adders of the receptive fields depend on the choice of a host."""
    return config.receptive_fields == SETTABLE and config.frontend == "digital"


def selects(config: ReadoutConfig) -> bool:
    """Return True if an external multiplexer needs select lines."""
    return config.receptive_fields == SETTABLE and config.frontend == "analog"
