"""Decay tick counter of the N-LCS array, staggered over the rows."""

from typing import Any

import numpy as np
from amaranth.hdl import Cat, Module, Mux, Signal
from amaranth.lib.wiring import In, Out

from eskin.model.config import ReadoutConfig
from eskin.model.decay import decay_phases
from eskin.rtl.block import Block


class DecayTicks(Block[ReadoutConfig]):
    """Counter that times the leak of the whole N-LCS array, for leak periods of at least two ticks.

    Attributes
    ----------
    tick : In(1)
        Sample tick.
    decay : Out(distinct phases)
        High in the clock of a sample tick in which the rows of that phase leak; phases in rising order.
    """

    module_name = "eskin_decay"

    def __init__(self, config: ReadoutConfig) -> None:
        self.phases = np.unique(decay_phases(config)).tolist()
        super().__init__(config, {"tick": In(1), "decay": Out(len(self.phases))})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        count = Signal(range(self.config.leak_period))
        with m.If(self.tick):
            m.d.sync += count.eq(Mux(count == self.config.leak_period - 1, 0, (count + 1)[: len(count)]))
        m.d.comb += self.decay.eq(Cat(self.tick & (count == phase) for phase in self.phases))
        return m
