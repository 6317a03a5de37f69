"""Cycle-accurate model of the register file: writes, reads and counters."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import NamedTuple

from eskin.model.config import ReadoutConfig
from eskin.model.registers.description import WORD_BITS, Register, registers


class Write(NamedTuple):
    """A register write: address and word."""

    address: int
    word: int


class RegisterFile:
    """State of all registers of a readout, updated clock by clock.

    The file refuses a word with a field out of range as a whole, and any write to a read-only register or an unused
    address. Unused addresses read 0. A counter stops at its end.
    """

    def __init__(self, config: ReadoutConfig) -> None:
        self.at: dict[int, Register] = {register.address: register for register in registers(config)}
        kinds = ("pulse", "counter")
        self.moving = {at for at, register in self.at.items() if any(f.kind in kinds for f in register.fields)}
        """Addresses of the registers that change without a write."""
        self.reset()

    def reset(self) -> None:
        """Set all registers to their reset values."""
        self.words = {address: register.reset for address, register in self.at.items()}  # by address
        self.written: frozenset[str] = frozenset()  # fields that report a write to the hardware in this clock
        self._signals: dict[str, int] | None = None  # as last returned, until a register changes

    def read(self, address: int) -> int:
        """Return the word read at an address; 0 for pulses and unused addresses."""
        if address not in self.at:
            return 0
        word, fields = self.words[address], self.at[address].fields
        return sum(field.of(word) << field.low for field in fields if field.kind != "pulse")

    def signals(self) -> dict[str, int]:
        """Return the value of every setting and pulse by signal name."""
        if self._signals is not None:
            return self._signals
        found: dict[str, int] = {}
        for address, register in self.at.items():
            for field in register.fields:
                if field.kind in ("setting", "pulse"):
                    value = field.of(self.words[address]) << (register.index or 0) * WORD_BITS
                    found[register.signal(field)] = found.get(register.signal(field), 0) | value
        self._signals = found
        return found

    def clock(self, write: Write | None, counted: Collection[str] = (), clear: bool = False) -> None:
        """Apply a rising edge with a register write, the counted signals, and a clear of all counters."""
        written = set()
        for address in self.moving | ({write.address} & self.at.keys() if write is not None else set()):
            register = self.at[address]
            accepted = write is not None and write.address == address and register.allows(write.word)
            word = 0
            for field in register.fields:
                value = field.of(self.words[address])
                if field.kind == "counter":
                    counts = register.signal(field) in counted and value != (1 << field.width) - 1
                    value = 0 if clear else value + counts
                elif field.kind == "pulse":
                    value = 0
                if accepted and write is not None and field.kind in ("setting", "pulse"):
                    value = field.of(write.word)
                    if field.announced:
                        written.add(register.signal(field))
                word |= value << field.low
            if word != self.words[address]:
                self.words[address], self._signals = word, None
        self.written = frozenset(written)


class Settings(NamedTuple):
    """The register settings that control the readout, as the fields of ``ReadoutConfig`` of the same names.

    ``mask`` has a bit for each taxel. ``receptive_fields`` has two: the number of its field in
    ``model.encoders.fields.CHOICES``.
    """

    resolution: int
    leak_shift: int
    leak_period: int
    window_period: int
    mask: int
    receptive_fields: int = 0

    @classmethod
    def of(cls, config: ReadoutConfig, signals: Mapping[str, int]) -> Settings:
        """Return the settings for signals of the register file; missing signals take the built-in values."""
        whole, whole_fields = (bits // WORD_BITS * WORD_BITS for bits in (config.taxels, 2 * config.taxels))
        return cls(
            resolution=signals["resolution_bits"],
            leak_shift=signals.get("decay_shift", config.leak_shift),
            leak_period=signals.get("decay_period", config.leak_period),
            window_period=signals.get("window_period", config.window_period),
            mask=signals.get("mask_taxels", 0) | signals.get("mask_rest_taxels", 0) << whole,
            receptive_fields=signals.get("fields_taxels", 0) | signals.get("fields_rest_taxels", 0) << whole_fields,
        )
