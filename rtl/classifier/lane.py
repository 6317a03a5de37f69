"""One lane: the potentials of every lanes-th hidden neuron, and their adder."""

from typing import Any

from amaranth.hdl import Cat, Module, Mux, Signal, signed, unsigned
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out

from eskin.model.classifier.config import ClassifierConfig
from eskin.rtl.block import Block
from eskin.rtl.classifier.numbers import add


class Limit(Block[ClassifierConfig]):
    """Selection of the value that a lane writes: the sum, a limit of its bits, or the value that is set.

    With these two select bits, each bit of the potential takes one table of four inputs. The delivered Verilog marks
    this module with ``keep_hierarchy``: otherwise synthesis dissolves the select bits and needs twice the tables.

    Attributes
    ----------
    set_valid : In(1)
    left, right, total : In(1)
        Signs of the two numbers and of their sum in as many bits.
    saturated, other : Out(1)
        00: the sum; 01: the value that is set; 10: the lowest, 11: the highest number.
    """

    module_name = "eskin_limit"

    def __init__(self, config: ClassifierConfig) -> None:
        inputs = dict.fromkeys(("set_valid", "left", "right", "total"), In(1))
        super().__init__(config, inputs | {"saturated": Out(1), "other": Out(1)})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        m.d.comb += [
            self.saturated.eq(~self.set_valid & (self.left == self.right) & (self.left != self.total)),
            self.other.eq(self.set_valid | (~self.left & ~self.right & self.total)),
        ]
        return m


class Lane(Block[ClassifierConfig]):
    """Lane that reads and writes a potential in the same clock, so that additions never stall.

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
                "group": In(unsigned(config.lane_bits)) if config.lane_bits else None,
                "set_group": In(unsigned(config.lane_bits)) if config.lane_bits else None,
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
        bits = config.membrane_bits
        value = Signal(signed(bits))
        written = Signal()
        m.d.comb += written.eq(self.add_valid | self.set_valid)
        if config.saturates and len(weight) <= bits:
            total = add(m, self.potential, weight, bits, False)
            limit = Limit(config)
            limit.place(m, "limit", platform)
            m.d.comb += [
                limit.set_valid.eq(self.set_valid),
                limit.left.eq(self.potential[-1]),
                limit.right.eq(weight[-1]),
                limit.total.eq(total[-1]),
            ]
            end = Cat(limit.other.replicate(bits - 1), ~limit.other)
            m.d.comb += value.eq(Mux(limit.saturated, end, Mux(limit.other, self.set_value, total)))
        else:
            total = add(m, self.potential, weight, bits, config.saturates)
            m.d.comb += value.eq(Mux(self.set_valid, self.set_value, total))
        if not config.lane_bits:
            single = Signal(signed(config.membrane_bits))
            m.d.comb += self.potential.eq(single)
            with m.If(written):
                m.d.sync += single.eq(value)
            return m
        memory = Memory(shape=unsigned(config.membrane_bits), depth=1 << config.lane_bits, init=[])
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
