"""Registers of a configuration, read from the SystemRDL description ``eskin_registers.rdl``."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

from eskin.base.errors import InputError
from eskin.base.packages import missing
from eskin.model import __version__
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import SETTABLE

SOURCE = Path(__file__).with_name("eskin_registers.rdl")
NAME = SOURCE.stem
WORD_BITS = 32
WORD_BYTES = WORD_BITS // 8

Kind = Literal["constant", "setting", "pulse", "counter"]


@dataclass(frozen=True)
class Field:
    """A bit field of a register."""

    name: str
    low: int  # place of the lowest bit
    width: int
    reset: int
    kind: Kind
    """``constant`` for ever; ``setting``, written and read back; ``pulse``, 1 for one clock after a 1 was written;
    ``counter`` of its input, which stops at its end."""
    least: int  # writable value
    most: int
    announced: bool  # the hardware behind the register is notified of a write (``swmod``)
    meaning: str

    @property
    def bits(self) -> int:
        """Number of bits that can be non-zero."""
        return min(self.width, self.most.bit_length())

    def of(self, word: int) -> int:
        """Return the value of the field in a register word."""
        return word >> self.low & (1 << self.width) - 1

    def allows(self, word: int) -> bool:
        """Return True if a register word has an allowed value in this field."""
        return self.kind != "setting" or self.least <= self.of(word) <= self.most


@dataclass(frozen=True)
class Register:
    """A 32-bit register at a byte address, with its fields from the lowest bit on.

    ``index`` is the number within an array of registers of that name.
    """

    name: str
    index: int | None
    address: int
    title: str
    fields: tuple[Field, ...]

    @property
    def key(self) -> str:
        """Name of the register, with the index for an element of a register array."""
        return self.name if self.index is None else f"{self.name}[{self.index}]"

    @property
    def writable(self) -> bool:
        """True if writing the register has an effect."""
        return any(field.kind in ("setting", "pulse") for field in self.fields)

    @property
    def reset(self) -> int:
        """Value of the register after reset."""
        return sum(field.reset << field.low for field in self.fields)

    def allows(self, word: int) -> bool:
        """Return True if the register accepts a word: all fields of the word are in range."""
        return self.writable and all(field.allows(word) for field in self.fields)

    def signal(self, field: Field) -> str:
        """Return the signal name of a field, shared by all elements of a register array."""
        return f"{self.name}_{field.name}"


def parameters(config: ReadoutConfig) -> dict[str, Any]:
    """Return the SystemRDL parameters for a configuration."""
    major, minor, patch = (int(part) for part in __version__.split("+")[0].split("."))
    return {
        "MAJOR": major,
        "MINOR": minor,
        "PATCH": patch,
        "ROWS": config.rows,
        "COLUMNS": config.columns,
        "ENCODING": config.encoder.code,
        "SAMPLE_BITS": config.sample_bits,
        "RESOLUTION": config.resolution,
        "LEAKS": config.encoder.leaks,
        "LEAK_SHIFT": config.leak_shift,
        "LEAK_PERIOD": config.leak_period,
        "CLOSES": config.closes,
        "WINDOW_PERIOD": config.window_period,
        "POLARITY": config.has_polarity,
        "SETTABLE": config.receptive_fields == SETTABLE,
    }


def compiled(given: dict[str, Any]) -> Any:
    """Return the address map for SystemRDL parameters, elaborated by systemrdl-compiler."""
    try:
        from systemrdl import RDLCompiler
    except ImportError:
        raise InputError(missing("systemrdl")) from None
    compiler = RDLCompiler()
    compiler.compile_file(str(SOURCE))
    return compiler.elaborate(top_def_name=NAME, parameters=given).top


@cache
def registers(config: ReadoutConfig) -> tuple[Register, ...]:
    """Return all registers of a configuration in rising order of addresses."""
    return walk(compiled(parameters(config)))


def walk(top: Any) -> tuple[Register, ...]:
    """Return the registers of an elaborated address map."""
    found = []
    for node in top.registers(unroll=True):
        index = node.current_idx[0] if node.is_array else None
        fields = tuple(_field(item) for item in node.fields())
        found.append(Register(node.inst_name, index, node.absolute_address, node.get_property("name"), fields))
    return tuple(sorted(found, key=lambda register: register.address))


def _field(node: Any) -> Field:
    """Return the field for a node of the elaborated description."""
    kind: Kind = "constant"
    if node.get_property("counter"):
        kind = "counter"
    elif node.get_property("singlepulse"):
        kind = "pulse"
    elif node.is_sw_writable:
        kind = "setting"
    most = node.get_property("most", default=None)
    return Field(
        name=node.inst_name,
        low=node.low,
        width=node.width,
        reset=node.get_property("reset"),
        kind=kind,
        least=node.get_property("least", default=None) or 0,
        most=(1 << node.width) - 1 if most is None else most,
        announced=bool(node.get_property("swmod")),
        meaning=node.get_property("desc"),
    )
