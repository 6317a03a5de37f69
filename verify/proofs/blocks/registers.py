"""Properties of the register file: a read returns the last written word, and every counter is exact."""

from __future__ import annotations

from typing import Any

from amaranth.hdl import Cat, Const, Module, Mux, Signal, Value
from amaranth.lib.wiring import In

from eskin.model.config import ReadoutConfig
from eskin.model.registers.description import WORD_BITS, Register, registers
from eskin.rtl.logic import or_tree
from eskin.rtl.registers.file import COUNTS, WRITTEN, RegisterFile
from eskin.verify.proofs.checker import Checker, Property, before, implies


class RegistersChecker(Checker[ReadoutConfig]):
    """Checker of the register file; bus and counted signals are free.

    Attributes
    ----------
    watch : In(bits)
        A register, any, for good; and a bit of the mask.
    """

    block = RegisterFile
    properties = (
        Property("read_as_written", "a read returns the last valid word written to the address, or the reset value"),
        Property("constants_hold", "an identification register never changes"),
        Property("holes_read_zero", "addresses without a register and pulse fields read 0"),
        Property("always_in_range", "no setting ever leaves its range"),
        Property("mask_reaches_taxel", "bit i of the mask is the bit last written for taxel i"),
        Property("told_once", "pulses and write strobes last one clock, the clock after the write"),
        Property(
            "counted_once", "a counter rises by one in every counted clock, up to its maximum, and in no other clock"
        ),
    )

    def observed(self, config: ReadoutConfig) -> dict[str, Any]:
        count = max(len(registers(config)), config.taxels)
        return super().observed(config) | {"watch": In((count - 1).bit_length())}

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        found = registers(self.config)
        self._words(m, [register for register in found if _settings(register)])
        self._fixed(m, found)
        self._mask(m, [register for register in found if register.name.startswith("mask")])
        self._pulses(m, found)
        self._counters(m, found)
        return self.finish(m)

    def _words(self, m: Module, found: list[Register]) -> None:
        """Track the word of the watched register, and check every setting."""
        address, reset, described, allowed = (
            self._of_watched(list(values))
            for values in (
                (Const(r.address, WORD_BITS) for r in found),
                (Const(r.reset, WORD_BITS) for r in found),
                (Const(sum((1 << f.width) - 1 << f.low for f in r.fields), WORD_BITS) for r in found),
                (self._allowed(r) for r in found),
            )
        )
        known, word, here = Signal(), Signal(WORD_BITS), Signal()
        m.d.comb += here.eq((self.address == address) & (self.watch < len(found)))
        with m.If(self.write & here & allowed):
            m.d.sync += [known.eq(1), word.eq(self.write_data & described)]
        expected = Mux(known, word, reset)
        self.promise(m, "read_as_written", implies(here, self.read_data == expected), here & known & (word != reset))
        ranges, moved = [], []
        for register in found:
            for field in register.fields:
                if field.kind == "setting" and self.has(register.signal(field)) and register.index is None:
                    value = getattr(self, register.signal(field))
                    ranges.append((value >= field.least) & (value <= field.most))
                    moved.append(value != field.reset)
        self.promise(m, "always_in_range", Cat(ranges).all(), Cat(moved).any())

    def _of_watched(self, values: list[Value]) -> Value:
        """Return the value of the watched register."""
        return or_tree([value & (self.watch == i).replicate(len(value)) for i, value in enumerate(values)])

    def _allowed(self, register: Register) -> Value:
        """Return whether the write data are allowed in a register."""
        data = [(self.write_data[f.low :][: f.width], f) for f in register.fields]
        return Cat([(value >= f.least) & (value <= f.most) for value, f in data]).all()

    def _fixed(self, m: Module, found: tuple[Register, ...]) -> None:
        right, written, free = [], Signal(), Signal()
        for register in found:
            if all(field.kind == "constant" for field in register.fields):
                here = self.address == register.address
                right.append(implies(here, self.read_data == register.reset))
                with m.If(here & self.write & (self.write_data != register.reset)):
                    m.d.sync += written.eq(1)
        self.promise(m, "constants_hold", Cat(right).all(), written)
        silent = [r.address for r in found if all(field.kind == "pulse" for field in r.fields)]
        silent_here = Cat(self.address == address for address in silent).any()
        m.d.comb += free.eq(~Cat(self.address == r.address for r in found).any() | silent_here)
        after = before(m, free & self.write & self.write_data.all(), "written_there")
        self.promise(m, "holes_read_zero", implies(free, self.read_data == 0), free & after)

    def _mask(self, m: Module, found: list[Register]) -> None:
        """Track the mask bit of the watched taxel."""
        bit = Signal(init=1)
        start = 0
        shown: list[Value] = []
        for register in found:
            (field,) = register.fields
            place = self.watch - start
            mine = (self.watch >= start) & (self.watch < start + field.width)
            with m.If(self.write & (self.address == register.address) & mine):
                m.d.sync += bit.eq((self.write_data >> place[:5])[0])
            start += field.width
            if register.index in (None, 0):
                shown.append(getattr(self, register.signal(field)))
        is_one = (Cat(shown) >> self.watch)[0]
        there = self.watch < start
        self.promise(m, "mask_reaches_taxel", implies(there, is_one == bit), there & ~is_one)

    def _pulses(self, m: Module, found: tuple[Register, ...]) -> None:
        right, seen = [], []
        for register in found:
            for field in register.fields:
                written = self.write & (self.address == register.address) & self._allowed(register)
                if field.kind == "pulse":
                    value = getattr(self, register.signal(field))
                    written &= self.write_data[field.low]
                elif field.announced:
                    value = getattr(self, register.signal(field) + WRITTEN)
                else:
                    continue
                due = before(m, written, f"{register.name}_{field.name}")
                right.append(value == due)
                seen.append(due & ~value | value & due)
        self.promise(m, "told_once", Cat(right).all(), Cat(seen).any())

    def _counters(self, m: Module, found: tuple[Register, ...]) -> None:
        right, seen = [], []
        for register in found:
            for field in register.fields:
                if field.kind == "counter":
                    count = Signal(field.width, name=f"{register.name}_count")
                    with m.If(self.clear):
                        m.d.sync += count.eq(0)
                    with m.Elif(getattr(self, register.signal(field) + COUNTS) & (count != (1 << field.width) - 1)):
                        m.d.sync += count.eq(count + 1)
                    here = self.address == register.address
                    right.append(implies(here, self.read_data == count))
                    seen.append(here & (count == 3))
        self.promise(m, "counted_once", Cat(right).all(), Cat(seen).any())


def _settings(register: Register) -> bool:
    return all(field.kind == "setting" for field in register.fields)
