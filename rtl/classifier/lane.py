"""One lane: the potentials of every lanes-th hidden neuron, and their adder."""

from __future__ import annotations

from typing import Any

from amaranth.hdl import Module, Mux, Signal, signed, unsigned
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out

from eskin.model.classifier.config import ClassifierConfig
from eskin.rtl.block import Block
from eskin.rtl.classifier.numbers import add


class Lane(Block[ClassifierConfig]):
    """Lane that reads and writes a potential in every clock, so that additions never stall.

    A value that is set goes past the adder; ``set_group`` is then another group than that which is read.

    Attributes
    ----------
    group, set_group : In
        Which of its potentials is read, and which is written; absent where there is one.
    potential : Out(signed)
        As it is in this clock.
    add_valid, recurrent, input_weight, recurrent_weight : In
        Add one of the two weights at the end of this clock.
    set_valid, set_value : In
        Write a potential instead.
    """

    module_name = "eskin_lane"

    def __init__(self, config: ClassifierConfig) -> None:
        super().__init__(
            config,
            {
                "group": In(unsigned(config.row_bits)) if config.row_bits else None,
                "set_group": In(unsigned(config.row_bits)) if config.row_bits else None,
                "potential": Out(signed(config.membrane_bits)),
                "add_valid": In(1),
                "recurrent": In(1),
                "input_weight": In(signed(config.in_bits)),
                "recurrent_weight": In(signed(config.rec_bits)),
                "set_valid": In(1),
                "set_value": In(signed(config.membrane_bits)),
            },
        )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        config = self.config
        weight = Mux(
            self.recurrent, self.recurrent_weight << config.rec_shift, self.input_weight << config.in_shift
        ).as_signed()
        total = add(m, self.potential, weight, config.membrane_bits, config.saturates)
        value = Signal(signed(config.membrane_bits))
        written = Signal()
        m.d.comb += [
            value.eq(Mux(self.set_valid, self.set_value, total)),
            written.eq(self.add_valid | self.set_valid),
        ]
        if not config.row_bits:
            single = Signal(signed(config.membrane_bits))
            m.d.comb += self.potential.eq(single)
            with m.If(written):
                m.d.sync += single.eq(value)
            return m
        memory = Memory(shape=unsigned(config.membrane_bits), depth=1 << config.row_bits, init=[])
        m.submodules.memory = memory
        read, write = memory.read_port(domain="comb"), memory.write_port()
        m.d.comb += [
            read.addr.eq(self.group),
            self.potential.eq(read.data),
            write.addr.eq(self.set_group),
            write.data.eq(value),
            write.en.eq(written),
        ]
        return m
