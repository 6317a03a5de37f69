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
    add_valid, weight : In
        Add a weight at the end of this clock.
    recurrent : In(1)
        The weight is a recurrent one; absent where both kinds count the same.
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
                "weight": In(signed(config.weight_bits)),
                "recurrent": In(1) if config.in_shift != config.rec_shift else None,
                "set_valid": In(1),
                "set_value": In(signed(config.membrane_bits)),
            },
        )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        config = self.config
        shifted = self.weight << config.in_shift
        if config.in_shift != config.rec_shift:
            shifted = Mux(self.recurrent, self.weight << config.rec_shift, shifted)
        total = add(m, self.potential, shifted, config.membrane_bits, config.saturates)
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
