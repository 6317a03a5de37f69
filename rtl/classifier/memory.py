"""The weight memories, each a separate module: block RAM, or a placeholder for a macro."""

from __future__ import annotations

from typing import Any

from amaranth.hdl import Module, signed, unsigned
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out

from eskin.model.classifier.config import ClassifierConfig
from eskin.rtl.block import Block


class WordMemory(Block[ClassifierConfig]):
    """A memory with one port to read and one to write; no reset, no initial content.

    Latency: address at clock t, word at t + 1. A word that is written in clock t is read from an address of t + 1 on;
    in the clock of a write nothing is read.

    Attributes
    ----------
    read_address, read_data : In, Out
    write_valid, write_address, write_data : In
    """

    def __init__(self, config: ClassifierConfig, words: int, bits: int) -> None:
        self.words, self.bits = words, bits
        address = unsigned(address_bits(words))
        super().__init__(
            config,
            {
                "read_address": In(address),
                "read_data": Out(bits),
                "write_valid": In(1),
                "write_address": In(address),
                "write_data": In(bits),
            },
        )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        m.submodules.memory = memory = Memory(shape=unsigned(self.bits), depth=self.words, init=[])
        read, write = memory.read_port(), memory.write_port()
        m.d.comb += [
            read.addr.eq(self.read_address),
            read.en.eq(~self.write_valid),  # so that no memory has to say what a collision reads
            self.read_data.eq(read.data),
            write.addr.eq(self.write_address),
            write.data.eq(self.write_data),
            write.en.eq(self.write_valid),
        ]
        return m


class WeightMemory(WordMemory):
    """Rows of weights, ``lanes`` in a word: one row per hidden neuron, then one per channel."""

    module_name = "eskin_weights"

    def __init__(self, config: ClassifierConfig) -> None:
        super().__init__(config, config.weight_words, config.lanes * config.weight_bits)


class NeuronMemory(WordMemory):
    """One row for each neuron: weights to the outputs, bias, and the bias of the output with the same number."""

    module_name = "eskin_neuron_weights"

    def __init__(self, config: ClassifierConfig) -> None:
        super().__init__(config, config.neuron_words, config.neuron_bits)


class PotentialMemory(Block[ClassifierConfig]):
    """The hidden potentials of neurons with a synaptic current, which is in the lanes.

    Latency: address at clock t, potential at t + 1. No reset: clearing a scan writes all potentials.

    Attributes
    ----------
    read_valid, read_address, read_data : In, In, Out
        Never of the address that is written in the same clock.
    write_valid, write_address, write_data : In
    """

    module_name = "eskin_potentials"

    def __init__(self, config: ClassifierConfig) -> None:
        address = unsigned(address_bits(config.hidden))
        super().__init__(
            config,
            {
                "read_valid": In(1),
                "read_address": In(address),
                "read_data": Out(signed(config.membrane_bits)),
                "write_valid": In(1),
                "write_address": In(address),
                "write_data": In(signed(config.membrane_bits)),
            },
        )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        shape = unsigned(self.config.membrane_bits)
        m.submodules.memory = memory = Memory(shape=shape, depth=self.config.hidden, init=[])
        read, write = memory.read_port(), memory.write_port()
        m.d.comb += [
            read.addr.eq(self.read_address),
            read.en.eq(self.read_valid),
            self.read_data.eq(read.data),
            write.addr.eq(self.write_address),
            write.data.eq(self.write_data),
            write.en.eq(self.write_valid),
        ]
        return m


def address_bits(words: int) -> int:
    """Return the bits of the address of a memory."""
    return max((words - 1).bit_length(), 1)
