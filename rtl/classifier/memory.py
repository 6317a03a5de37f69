"""Weight memories as separate modules: block RAM, or a placeholder for a memory macro."""

from __future__ import annotations

from typing import Any

from amaranth.hdl import Module, Signal, Value, signed, unsigned
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out

from eskin.model.classifier.config import ClassifierConfig
from eskin.rtl.block import Block

WIDEST = 64
"""Largest number of bits in one array. Yosys maps one array of 4,096 x 128 bits to 30 block RAMs and 128 multiplexers,
but two arrays of 4,096 x 64 bits to 32 block RAMs without multiplexers."""


class WordMemory(Block[ClassifierConfig]):
    """Memory with one read port and one write port, without reset or initial content.

    Latency: address at clock t, word at t + 1. A word that is written in clock t is read from an address of t + 1 on;
    in the clock of a write nothing is read.

    Attributes
    ----------
    read_valid, read_address, read_data : In, In, Out
        The word stays the same until the next read.
    write_valid, write_address, write_data : In
    """

    def __init__(self, config: ClassifierConfig, words: int, bits: int) -> None:
        self.words, self.bits = words, bits
        address = unsigned(address_bits(words))
        super().__init__(
            config,
            {
                "read_valid": In(1),
                "read_address": In(address),
                "read_data": Out(bits),
                "write_valid": In(1),
                "write_address": In(address),
                "write_data": In(bits),
            },
        )

    def elaborate(self, platform: Any) -> Module:
        return _memory(self, self.words, self.bits, self.read_valid & ~self.write_valid)


class InputMemory(WordMemory):
    """Memory of the input weights, with ``lanes`` weights per word and a row for each channel."""

    module_name = "eskin_input_weights"

    def __init__(self, config: ClassifierConfig) -> None:
        super().__init__(config, config.input_words, config.lanes * config.in_bits)


class RecurrentMemory(WordMemory):
    """Memory of the recurrent weights, with ``lanes`` weights per word and a row for each hidden neuron."""

    module_name = "eskin_recurrent_weights"

    def __init__(self, config: ClassifierConfig) -> None:
        super().__init__(config, config.recurrent_words, config.lanes * config.rec_bits)


class NeuronMemory(WordMemory):
    """Memory of the output weights and biases, with one row per neuron."""

    module_name = "eskin_neuron_weights"

    def __init__(self, config: ClassifierConfig) -> None:
        super().__init__(config, config.neuron_words, config.neuron_bits)


class PotentialMemory(Block[ClassifierConfig]):
    """Memory of the potentials of hidden neurons that have a synaptic current.

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
        return _memory(self, self.config.hidden, self.config.membrane_bits, self.read_valid)


def _memory(block: WordMemory | PotentialMemory, words: int, bits: int, reads: Value) -> Module:
    """Return a block RAM between the ports of a block.

    The register behind an asynchronous port, with its enable beside that of the write port, lets synthesis find out
    that nobody looks at a collision. A synchronous port of Amaranth promises the old word: an ECP5 has no block RAM
    that does, and gets flops and multiplexers around it.
    """
    m = Module()
    word = Signal.like(block.read_data, name="word", reset_less=True)
    m.d.comb += block.read_data.eq(word)
    for first in range(0, bits, WIDEST):
        part = slice(first, min(first + WIDEST, bits))
        memory = Memory(shape=unsigned(part.stop - first), depth=words, init=[])
        m.submodules[f"memory_{first // WIDEST}" if bits > WIDEST else "memory"] = memory
        read, write = memory.read_port(domain="comb"), memory.write_port()
        m.d.comb += [
            read.addr.eq(block.read_address),
            write.addr.eq(block.write_address),
            write.data.eq(block.write_data[part]),
            write.en.eq(block.write_valid),
        ]
        with m.If(reads):
            m.d.sync += word[part].eq(read.data)
    return m


def address_bits(words: int) -> int:
    """Return the address width of a memory with the given number of words."""
    return max((words - 1).bit_length(), 1)
