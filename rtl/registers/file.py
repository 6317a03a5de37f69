"""Register file generated from the SystemRDL description."""

from typing import Any, ClassVar

from amaranth.hdl import Cat, Const, Module, Signal, Value
from amaranth.lib.wiring import In, Out

from eskin.model.config import ReadoutConfig
from eskin.model.registers.description import WORD_BITS, Field, Register, registers
from eskin.model.registers.spi import ADDRESS_BITS
from eskin.rtl.block import Block
from eskin.rtl.logic import or_tree

BUS = {"address": In(ADDRESS_BITS), "write": In(1), "write_data": In(WORD_BITS), "read_data": Out(WORD_BITS)}
WRITTEN, COUNTS = "_written", "_counts"
"""Ends of signal names behind the name of a field: its register was written; its counter counts."""


def signals(config: ReadoutConfig) -> dict[str, Any]:
    """Return the ports of the register file: settings and counter inputs."""
    ports: dict[str, Any] = {}
    for register in registers(config):
        for field in register.fields:
            name = register.signal(field)
            if field.kind in ("setting", "pulse"):
                bits = field.bits * ((register.index or 0) + 1)
                ports[name] = Out(bits) if bits else None
                if field.announced:
                    ports[name + WRITTEN] = Out(1)
            elif field.kind == "counter":
                ports[name + COUNTS] = In(1)
    return ports


class RegisterFile(Block[ReadoutConfig]):
    """Register file that stores the settings of the host, and counts events and clocks of waiting.

    The file refuses a word with a field out of range as a whole. Unused addresses read 0. A counter stops at its end. A
    flop is clocked only if its register is written, or its counter counts.

    Attributes
    ----------
    address, write, write_data, read_data
        The bus of the SPI slave, seen from the other side; ``read_data`` follows ``address`` in the same clock.
    clear : In(1)
        All counters become 0.
    REGISTER_FIELD : Out
        A setting, or a pulse of one clock.
    REGISTER_FIELD_written : Out(1)
        The register was written in the clock before.
    REGISTER_FIELD_counts : In(1)
        The counter counts this clock.
    """

    module_name = "eskin_registers"
    counter_bits: ClassVar[int] = WORD_BITS

    def __init__(self, config: ReadoutConfig) -> None:
        super().__init__(config, {**BUS, "clear": In(1), **signals(config)})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        words: list[Value] = []
        shown: dict[str, list[Value]] = {}
        for register in registers(self.config):
            here = Signal(name=f"at_{_plain(register)}")
            m.d.comb += here.eq(self.address == register.address)
            allowed = [check for field in register.fields for check in self._ranges(field)]
            write = Signal(name=f"write_{_plain(register)}")
            if register.writable:
                m.d.comb += write.eq(self.write & here & Cat(*allowed, Const(1, 1)).all())
            word: Value = Const(0, 0)
            for field in register.fields:
                value = self._field(m, register, field, write)
                if field.kind in ("setting", "pulse"):
                    shown.setdefault(register.signal(field), []).append(value)
                read = Const(0, 0) if field.kind == "pulse" else value
                word = Cat(word, Const(0, field.low - len(word)), read)
            words.append(Cat(word, Const(0, WORD_BITS - len(word))) & here.replicate(WORD_BITS))
        m.d.comb += [
            getattr(self, name).eq(Cat(values)) for name, values in shown.items() if name in self.signature.members
        ]
        m.d.comb += self.read_data.eq(or_tree(words))
        return m

    def _ranges(self, field: Field) -> list[Value]:
        """Return the condition on the write data under which a field may be written."""
        value = self.write_data[field.low : field.low + field.width]
        limits = []
        if field.kind == "setting" and field.least:
            limits.append(value >= field.least)
        if field.kind == "setting" and field.most < (1 << field.width) - 1:
            limits.append(value <= field.most)
        return limits

    def _field(self, m: Module, register: Register, field: Field, write: Signal) -> Value:
        """Add a field of a register; return its value without bits that are always 0."""
        name = f"{_plain(register)}_{field.name}_bits"
        if field.kind == "constant":
            return Const(field.reset, field.width)
        if field.kind == "counter":
            count = Signal(min(field.width, self.counter_bits), init=field.reset, name=name)
            with m.If(self.clear):
                m.d.sync += count.eq(0)
            with m.Elif(getattr(self, register.signal(field) + COUNTS) & ~count.all()):
                m.d.sync += count.eq((count + 1)[: len(count)])
            return count
        kept = Signal(field.bits, init=field.reset, name=name)
        data = self.write_data[field.low : field.low + len(kept)]
        with m.If(write):
            m.d.sync += kept.eq(data)
        if field.kind == "pulse":
            with m.Elif(kept.any()):
                m.d.sync += kept.eq(0)
        if field.announced:
            told = Signal(name=f"{name}_told")
            with m.If(write | told):
                m.d.sync += told.eq(write)
            m.d.comb += getattr(self, register.signal(field) + WRITTEN).eq(told)
        return kept


class ShortRegisterFile(RegisterFile):
    """Register file with short counters, so that a bounded search reaches their end."""

    counter_bits = 3


def _plain(register: Register) -> str:
    return register.name if register.index is None else f"{register.name}_{register.index}"
