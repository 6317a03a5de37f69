"""Configuration of a readout behind AXI: the readout without a bus, and the format of its event stream."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter
from typing import Any, ClassVar

from eskin.base.configuration import Configuration, parameter
from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.tiles.config import TilesConfig

BUSES = ("axi",)
"""Names of all buses."""

BYTE_BITS = 8
MAX_TIME_BITS = 64


@dataclass(frozen=True, kw_only=True)
class BusConfig(Configuration):
    """A readout with the link stream, behind AXI4-Stream and, if it has registers, AXI4-Lite.

    ``TDATA`` is {0, time stamp, polarity, row, column}, filled to whole bytes. A field without bits is absent.

    Examples
    --------
    >>> config = BusConfig(readout=ReadoutConfig(rows=12, columns=16), time_bits=20)
    >>> config.data_bits, config.fields()
    (32, {'column': (0, 4), 'row': (4, 4), 'polarity': (8, 1), 'time stamp': (9, 20)})
    """

    bus: ClassVar[str] = "axi"

    readout: ReadoutConfig
    time_bits: int = parameter(
        0, "", "docs/specification.md, section 4", f"bits of the time stamp in clocks, 0 to {MAX_TIME_BITS}"
    )

    def __post_init__(self) -> None:
        self._check_types()
        self._check_range("time_bits", 0, MAX_TIME_BITS)
        if isinstance(self.readout, TilesConfig):
            raise InputError("a bus is for one readout, not for tiles")
        if not self.readout.protocol.streams:
            raise InputError(f"a readout behind a bus must have the link stream, not {self.readout.link}")

    reset = property(attrgetter("readout.reset"), doc="Reset style of the flip-flops.")
    clock_hz = property(attrgetter("readout.clock_hz"), doc="Clock frequency in hertz.")

    def fields(self) -> dict[str, tuple[int, int]]:
        """Return the lowest bit and the number of bits of every field of ``TDATA``, without empty fields."""
        config, low, found = self.readout, 0, {}
        widths = {"column": config.column_bits, "row": config.row_bits, "polarity": int(config.has_polarity)}
        for name, bits in (widths | {"time stamp": self.time_bits}).items():
            if bits:
                found[name] = (low, bits)
            low += bits
        return found

    @property
    def data_bits(self) -> int:
        """Bits of ``TDATA``: whole bytes, at least one."""
        used = self.readout.event_bits + self.time_bits
        return BYTE_BITS * max(1, -(-used // BYTE_BITS))

    def to_dict(self) -> dict[str, Any]:
        """Return all fields of readout and bus as one dictionary."""
        return self.readout.to_dict() | {"bus": self.bus, "time_bits": self.time_bits}

    @classmethod
    def from_dict(cls, fields: dict[str, Any]) -> BusConfig:
        """Return the configuration for a dictionary written by ``to_dict``."""
        readout = {name: value for name, value in fields.items() if name not in ("bus", "time_bits")}
        return cls(readout=ReadoutConfig.from_dict(readout), time_bits=fields["time_bits"])
