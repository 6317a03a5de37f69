"""Weight memories as separate modules: block RAM, or a placeholder for a memory macro."""

from collections.abc import Callable
from typing import Any

from amaranth.hdl import Module, Mux, Signal, Value, signed, unsigned
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out

from eskin.model.classifier.config import ClassifierConfig
from eskin.rtl.block import Block

WIDEST = 64
"""Largest number of bits in one array. Yosys maps one array of 4,096 x 128 bits to 30 block RAMs and 128 multiplexers,
but two arrays of 4,096 x 64 bits to 32 block RAMs without multiplexers."""

DEEPEST = 2048
"""Words of ``WIDEST`` bits above which a depth between two powers of two costs tables: Yosys maps 3,072 words to three
rows of block RAMs, and selects a row with two tables for each bit."""


class WordMemory(Block[ClassifierConfig]):
    """Memory with one read port and one write port, without reset or initial content.

    Latency: address at clock t, word at t + 1. A word that is written in clock t is read from an address of t + 1 on.

    The register behind an asynchronous port, with its enable beside that of the write port, lets synthesis find out
    that nobody looks at a collision. A synchronous port of Amaranth promises the old word: an ECP5 has no block RAM
    that does, and gets flops and multiplexers around it.

    Attributes
    ----------
    read_valid, read_address, read_data : In, In, Out
        The word stays the same until the next read; in the clock of a write nothing is read.
    write_valid, write_address, write_data : In
    """

    def __init__(self, config: ClassifierConfig, words: int, shape: Any) -> None:
        self.words, address = words, In(address_bits(words))
        read = {"read_valid": In(1), "read_address": address, "read_data": Out(shape)}
        super().__init__(config, read | {"write_valid": In(1), "write_address": address, "write_data": In(shape)})

    @property
    def reads(self) -> Value:
        """Condition under which a word is read."""
        return self.read_valid & ~self.write_valid

    @property
    def split(self) -> bool:
        """True if the words behind the largest power of two have arrays of their own."""
        return False

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        if not self.split:
            m.d.comb += self.read_data.eq(self._bank(m, self.words))
            return m
        first = 1 << len(self.read_address) - 1
        lower = self._bank(m, first, "_lower", lambda address: ~address[-1])
        upper = self._bank(m, self.words - first, "_upper", lambda address: address[-1])
        m.d.comb += self.read_data.eq(lower | upper)
        return m

    def _bank(self, m: Module, words: int, name: str = "", here: Callable[[Value], Value] | None = None) -> Signal:
        """Add arrays of words, and return the word that was read; 0 if its address is not ``here``."""
        word = Signal.like(self.read_data, name=f"word{name}", reset_less=True)
        bits = address_bits(words)
        for first in range(0, len(word), WIDEST):
            part = slice(first, min(first + WIDEST, len(word)))
            memory = Memory(shape=unsigned(part.stop - first), depth=words, init=[])
            m.submodules[f"memory{name}_{first // WIDEST}" if len(word) > WIDEST else f"memory{name}"] = memory
            read, write = memory.read_port(domain="comb"), memory.write_port()
            m.d.comb += [
                read.addr.eq(self.read_address[:bits]),
                write.addr.eq(self.write_address[:bits]),
                write.data.eq(self.write_data[part]),
                write.en.eq(self.write_valid & here(self.write_address) if here else self.write_valid),
            ]
            with m.If(self.reads):
                m.d.sync += word[part].eq(Mux(here(self.read_address), read.data, 0) if here else read.data)
        return word


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

    @property
    def split(self) -> bool:
        """True for a stack with many words, whose number is no power of two.

        An array whose word is not read gives 0. One table for each bit combines both words with the input weight.
        """
        return bool(self.config.layers) and self.words > DEEPEST and bool(self.words & (self.words - 1))


class NeuronMemory(WordMemory):
    """Memory of the output weights and biases, with one row per neuron."""

    module_name = "eskin_neuron_weights"

    def __init__(self, config: ClassifierConfig) -> None:
        super().__init__(config, config.neuron_words, config.neuron_weight_bits)


class ParameterMemory(WordMemory):
    """Memory of thresholds and leak shifts, with a word for each hidden neuron, and one for the output of its number.

    The leak shift stands above the threshold.
    """

    module_name = "eskin_neuron_parameters"

    def __init__(self, config: ClassifierConfig) -> None:
        super().__init__(config, config.parameter_words, config.parameter_bits)


class PotentialMemory(WordMemory):
    """Memory of the potentials of hidden neurons that have a synaptic current.

    It reads in the clock of a write too, never at the address that is written. Clearing a scan writes all potentials.
    """

    module_name = "eskin_potentials"

    def __init__(self, config: ClassifierConfig) -> None:
        super().__init__(config, config.hidden, signed(config.membrane_bits))

    @property
    def reads(self) -> Value:
        """Condition under which a word is read."""
        return self.read_valid


def address_bits(words: int) -> int:
    """Return the address width of a memory with the given number of words."""
    return max((words - 1).bit_length(), 1)
