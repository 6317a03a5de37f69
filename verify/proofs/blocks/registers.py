"""Properties of registers: a read returns the last written word, every counter is exact, and nothing else changes.

``RegistersChecker`` looks at the register file alone, ``HostChecker`` at the whole host interface between its pins and
the array.
"""

from types import SimpleNamespace
from typing import Any, ClassVar

from amaranth.hdl import Cat, Const, Module, Mux, Signal, Value
from amaranth.lib.wiring import In

from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import CHOICES
from eskin.model.registers.description import WORD_BITS, Register, registers
from eskin.rtl.logic import or_tree
from eskin.rtl.registers.file import BUS, COUNTS, WRITTEN, RegisterFile, ShortRegisterFile
from eskin.rtl.registers.host import SETTINGS, Host, ShortHost
from eskin.verify.proofs.blocks.spi import Transfers
from eskin.verify.proofs.checker import Checker, Promises, before, implies


def _allowed(register: Register, data: Value) -> Value:
    """Return whether data may be written to a register."""
    values = [(data[field.low :][: field.width], field) for field in register.fields]
    return Cat((value >= field.least) & (value <= field.most) for value, field in values).all()


class RegistersChecker(Checker[ReadoutConfig]):
    """Checker of the register file; bus and counted signals are free.

    ``watch`` is any register, for good; and a bit of the mask.
    """

    block: ClassVar[type[RegisterFile]] = RegisterFile

    def constants(self, config: ReadoutConfig) -> dict[str, int]:
        return {"watch": max(len(registers(config)), config.taxels)}

    def check(self, m: Module) -> Promises:
        found = registers(self.config)
        yield from self._words(m, [r for r in found if all(field.kind == "setting" for field in r.fields)])
        yield from self._fixed(m, found)
        yield from self._mask(m, [register for register in found if register.name.startswith("mask")])
        yield from self._pulses(m, found)
        yield from self._counters(m, found)

    def _words(self, m: Module, found: list[Register]) -> Promises:
        """Track the word of the watched register, and check every setting."""
        address, reset, described, allowed = (
            or_tree([value & (self.watch == i).replicate(len(value)) for i, value in enumerate(values)])
            for values in (
                (Const(r.address, WORD_BITS) for r in found),
                (Const(r.reset, WORD_BITS) for r in found),
                (Const(sum((1 << f.width) - 1 << f.low for f in r.fields), WORD_BITS) for r in found),
                (_allowed(r, self.write_data) for r in found),
            )
        )
        known, word = Signal(), Signal(WORD_BITS)
        here = (self.address == address) & (self.watch < len(found))
        with m.If(self.write & here & allowed):
            m.d.sync += [known.eq(1), word.eq(self.write_data & described)]
        expected = Mux(known, word, reset)
        yield "read_as_written", implies(here, self.read_data == expected), here & known & (word != reset)
        ranges, moved = [], []
        for register in found:
            for field in register.fields:
                if field.kind == "setting" and self.has(register.signal(field)) and register.index is None:
                    value = getattr(self, register.signal(field))
                    ranges.append((value >= field.least) & (value <= field.most))
                    moved.append(value != field.reset)
        yield "always_in_range", Cat(ranges).all(), Cat(moved).any()

    def _fixed(self, m: Module, found: tuple[Register, ...]) -> Promises:
        right, written = [], Signal()
        for register in found:
            if all(field.kind == "constant" for field in register.fields):
                here = self.address == register.address
                right.append(implies(here, self.read_data == register.reset))
                with m.If(here & self.write & (self.write_data != register.reset)):
                    m.d.sync += written.eq(1)
        yield "constants_hold", Cat(right).all(), written
        silent = [r.address for r in found if all(field.kind == "pulse" for field in r.fields)]
        silent_here = Cat(self.address == address for address in silent).any()
        free = ~Cat(self.address == r.address for r in found).any() | silent_here
        after = before(m, free & self.write & self.write_data.all(), "written_there")
        yield "holes_read_zero", implies(free, self.read_data == 0), free & after

    def _mask(self, m: Module, found: list[Register]) -> Promises:
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
        yield "mask_reaches_taxel", implies(there, is_one == bit), there & ~is_one

    def _pulses(self, m: Module, found: tuple[Register, ...]) -> Promises:
        right, seen = [], []
        for register in found:
            for field in register.fields:
                written = self.write & (self.address == register.address) & _allowed(register, self.write_data)
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
        yield "told_once", Cat(right).all(), Cat(seen).any()

    def _counters(self, m: Module, found: tuple[Register, ...]) -> Promises:
        right, seen = [], []
        for register in found:
            for field in register.fields:
                if field.kind == "counter":
                    bits = min(field.width, self.block.counter_bits)
                    counts = getattr(self, register.signal(field) + COUNTS)
                    number = self.count_to(m, (1 << bits) - 1, self.clear, counts, name=f"{register.name}_count")
                    here = self.address == register.address
                    right.append(implies(here, self.read_data == number))
                    seen.append(here & (number == 3))
        yield "counted_once", Cat(right).all(), Cat(seen).any()


class ShortRegistersChecker(RegistersChecker):
    """Checker of the register file with short counters."""

    block = ShortRegisterFile


class HostChecker(Checker[ReadoutConfig]):
    """Checker of the whole host interface, from the SPI pins to the settings of the array.

    It decodes the transfers at the pins and keeps the valid words of complete writes. Every output of the host follows
    from these words, so a write has an effect only when it is complete, and nothing else has an effect.
    """

    block: ClassVar[type[Host]] = Host
    only: ClassVar = {
        "restarts_when_told": lambda config: config.encoder.leaks,
        "tells_of_writes": lambda config: config.asks_between_ticks,
    }

    def check(self, m: Module) -> Promises:
        sent = self._transfers(m)
        words, writes = self._words(m, sent)
        value = {register.signal(f): words[register.key][f.low :][: f.bits] for register, f in self._fields("setting")}
        clear = before(m, writes["control"] & sent.word[0], "clear")

        bits = before(m, value["resolution_bits"], "bits")
        begun = before(m, Const(1, 1), "begun")
        highest = self.config.resolution
        step = Cat((begun & (bits == n)) | (~begun & (n == highest)) for n in range(highest, 0, -1))
        good, moved = self.step == step, ~self.step[0]
        for name in SETTINGS:
            if self.has(name):
                good &= getattr(self, name) == value[name]
        mask, fields = (
            Cat(words[r.key][: f.bits] for r, f in self._fields("setting") if r.name.startswith(name))
            for name in ("mask", "fields")
        )
        if len(fields):
            choices = [fields[2 * taxel :][:2] for taxel in range(self.config.taxels)]
            mask = mask & Cat(choice != CHOICES.index("off") for choice in choices)
            lines = Cat(Cat(choice == number for number in range(3)) for choice in choices)
            if self.has("choice"):
                good &= self.choice == fields
            else:
                good &= self.field_select == Mux(begun, before(m, lines, "lines"), lines)
        yield "set_as_written", good, moved

        quiet = (value["test_mode"] == 0) & ~clear
        expected = self.taxel_enable & mask & quiet.replicate(self.config.taxels)
        yield "masked_as_written", self.enabled == expected, ~mask[0] & quiet & self.taxel_enable[0]

        yield from self._reading(m, sent, words)
        silent = implies(value["test_mode"] == 0, self.row_request == 0)
        yield "no_pattern_unasked", silent, self.row_request != 0
        if self.has("wrote"):
            told, shown = before(m, self.wrote, "told"), Cat(self.step, self.port("field_select"))
            moves = begun & (shown != before(m, shown, "shown"))
            exact = self.wrote == before(m, sent.complete, "complete")
            yield "tells_of_writes", exact & implies(moves, told), moves
        if self.config.encoder.leaks:
            due = before(m, writes["decay"], "decay") | clear
            yield "restarts_when_told", self.decay_restart == due, due

    def _transfers(self, m: Module) -> Any:
        """Return the words that the host writes, with their addresses."""
        return Transfers(m, self, self.block.slave())

    def _fields(self, kind: str) -> list[tuple[Register, Any]]:
        return [(r, field) for r in registers(self.config) for field in r.fields if field.kind == kind]

    def _words(self, m: Module, sent: Any) -> tuple[dict[str, Signal], dict[str, Value]]:
        """Return the expected word of every register, and whether a valid word is written to it."""
        words, writes = {}, {}
        data = Cat(sent.word, Const(0, WORD_BITS - sent.word_bits))
        for register in registers(self.config):
            constant = sum(f.reset << f.low for f in register.fields if f.kind in ("setting", "constant"))
            word = Signal(WORD_BITS, init=constant, name=f"{register.name}_{register.index or 0}_word")
            write = sent.complete & (sent.address == register.address) & _allowed(register, data)
            if any(field.kind == "setting" for field in register.fields):
                described = sum((1 << f.bits) - 1 << f.low for f in register.fields)
                with m.If(write):
                    m.d.sync += word.eq(data & described)
            words[register.key], writes[register.key] = word, write
        return words, writes

    def _reading(self, m: Module, sent: Any, words: dict[str, Signal]) -> Promises:
        """Check the words of all registers at MISO, except the words of counters."""
        word, counts = self._at(sent.address, words)
        shown = sent.shown(m, word[: sent.word_bits])
        known = Signal()
        with m.If(sent.fall & sent.reads & sent.first):
            m.d.sync += known.eq(~counts)
        looks = sent.rise & sent.reads & known
        right = implies(looks, self.spi_miso == shown) & implies(~sent.reads, ~self.spi_miso)
        yield "read_as_written", right, looks & shown

    def _at(self, address: Value, words: dict[str, Signal]) -> tuple[Value, Value]:
        """Return the word at an address, and whether a counter is there."""
        counters = [register.key for register, _ in self._fields("counter")]
        addresses = {register.key: register.address for register in registers(self.config)}
        found = [words[key] & (address == place).replicate(WORD_BITS) for key, place in addresses.items()]
        return or_tree(found), Cat(address == addresses[key] for key in counters).any()


class BusHostChecker(HostChecker):
    """Checker of the host interface without its SPI slave; any register access may come in any clock."""

    cut: ClassVar[tuple[str, ...]] = ("eskin_spi",)

    def inner(self, config: ReadoutConfig) -> dict[str, Any]:
        return {f"spi_{name}": In(member.shape) for name, member in BUS.items()}

    def _transfers(self, m: Module) -> Any:
        return SimpleNamespace(
            complete=self.spi_write, address=self.spi_address, word=self.spi_write_data, word_bits=WORD_BITS
        )

    def _reading(self, m: Module, sent: Any, words: dict[str, Signal]) -> Promises:
        word, counts = self._at(sent.address, words)
        written = words["resolution"] != self.config.resolution
        yield "read_as_written", counts | (self.spi_read_data == word), written & (word == words["resolution"])


class ShortHostChecker(HostChecker):
    """Checker of the host interface with short addresses and words."""

    block = ShortHost
