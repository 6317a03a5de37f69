"""Configuration of the frame readout (docs/reference/frame.md)."""

import dataclasses
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any, Self

from eskin.base.configuration import Configuration, parameter
from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig

MAX_WORD_BITS = 64
MAX_CLOCKS = 1024
"""Largest number of settling and of conversion clocks."""

FRAME = "docs/reference/frame.md"

SHARED_FIELDS = ("rows", "columns", "sample_bits", "resolution", "reset", "sample_rate_hz", "clocks_per_sample")
"""Fields of ReadoutConfig that mean the same in both readouts; the others belong to the spiking one."""


@dataclass(frozen=True, kw_only=True)
class FrameConfig(Configuration):
    """All parameters of one frame readout; immutable and validated.

    ``readout`` contains all fields shared with the spiking readout: array, W, N, reset, and the sample rate. The sample
    rate is the frame rate, because every taxel is sampled once per frame.

    Parameters
    ----------
    readout : ReadoutConfig
        Array and sampling; the fields of ``SHARED_FIELDS`` count, N are the bits of the ADC.
    word_bits : int
        Bits of an output word, N..64.
    settle_clocks : int
        Clocks from a new multiplexer setting to the start of the conversion, 1..1024.
    conversion_clocks : int or None
        Clocks from ``adc_start`` to ``adc_done``, 1..1024, assumed for the clock frequency; the hardware accepts any
        number. None means N + 1: one decision per clock, then the code.
    """

    readout: ReadoutConfig = field(default_factory=ReadoutConfig)
    word_bits: int = parameter(16, "", FRAME, "frame: bits of an output word")
    settle_clocks: int = parameter(1, "", FRAME, "frame: clocks for the multiplexer to settle")
    conversion_clocks: int | None = parameter(
        None, "", FRAME, "frame: clocks of a conversion, for the clock rate [resolution + 1]"
    )

    def __post_init__(self) -> None:
        self._check_types()
        if self.readout.receptive_fields != "own":
            raise InputError("receptive fields belong to the spiking readout; leave receptive_fields out")
        if self.readout.registers != "none":
            raise InputError(f"registers belong to the spiking readout; leave registers={self.readout.registers} out")
        self._check_range("word_bits", self.resolution, MAX_WORD_BITS, low_name="resolution")
        self._check_range("settle_clocks", 1, MAX_CLOCKS)
        if self.conversion_clocks is not None:
            self._check_range("conversion_clocks", 1, MAX_CLOCKS)

    # -- shared with the spiking readout ---------------------------------------------------------

    rows = property(attrgetter("readout.rows"), doc="Rows of taxels.")
    columns = property(attrgetter("readout.columns"), doc="Columns of taxels.")
    taxels = property(attrgetter("readout.taxels"), doc="M, number of taxels.")
    sample_bits = property(attrgetter("readout.sample_bits"), doc="W, bits of the signed sample at the ADC input.")
    resolution = property(attrgetter("readout.resolution"), doc="N, bits of an ADC code.")
    reset = property(attrgetter("readout.reset"), doc='Reset style of the flip-flops, "sync" or "async".')
    frame_rate_hz = property(attrgetter("readout.sample_rate_hz"), doc="Frames per second, the rate of a taxel.")

    # -- derived numbers -------------------------------------------------------------------------

    @property
    def adc_clocks(self) -> int:
        """Assumed clocks of one conversion, from adc_start to adc_done."""
        return self.resolution + 1 if self.conversion_clocks is None else self.conversion_clocks

    @property
    def frame_clocks(self) -> int:
        """Smallest number of clocks from one accepted frame_start to the next."""
        return self.taxels * (self.settle_clocks + 1 + self.adc_clocks) + 1

    @property
    def words_per_frame(self) -> int:
        """Output words per frame."""
        return -(-self.taxels * self.resolution // self.word_bits)

    @property
    def clocks_per_frame(self) -> int:
        """Clocks per frame: the clocks per sample, or more if a scan of the array takes longer."""
        return max(self.readout.clocks_per_sample, self.frame_clocks)

    @property
    def clock_hz(self) -> float:
        """Clock frequency in hertz: the frame rate times ``clocks_per_frame``."""
        return self.frame_rate_hz * self.clocks_per_frame

    @property
    def bit_rate_hz(self) -> float:
        """Sample bits per second. A frame has ``resolution * taxels`` bits (N times M in Fig. 5a of the paper)."""
        return self.resolution * self.taxels * self.frame_rate_hz

    @property
    def word_rate_hz(self) -> float:
        """Output words per second."""
        return self.words_per_frame * self.frame_rate_hz

    # -- construction and exchange ---------------------------------------------------------------

    def replace(self, **changes: Any) -> Self:
        """Return a validated copy with changed fields; shared fields are in ``readout``."""
        shared = {name: changes.pop(name) for name in SHARED_FIELDS if name in changes}
        try:
            copy = dataclasses.replace(self, **changes)
            return dataclasses.replace(copy, readout=copy.readout.replace(**shared))
        except TypeError as error:
            raise InputError(f"unknown parameter in {', '.join(sorted(changes))}: {error}") from None

    def to_dict(self) -> dict[str, Any]:
        """Return all used fields as one flat dictionary."""
        fields = {name: getattr(self.readout, name) for name in SHARED_FIELDS}
        return fields | {name: getattr(self, name) for name in OWN_FIELDS} | {"conversion_clocks": self.adc_clocks}

    @classmethod
    def from_dict(cls, fields: Any) -> Self:
        """Return the configuration for a flat dictionary; fields of the spiking readout alone are ignored."""
        if not isinstance(fields, dict):
            raise InputError(f"a configuration must be a JSON object, not {type(fields).__name__}")
        own = {name: fields[name] for name in OWN_FIELDS if name in fields}
        readout = ReadoutConfig.from_dict({name: value for name, value in fields.items() if name not in own})
        return cls(readout=readout, **own)


OWN_FIELDS = tuple(f.name for f in dataclasses.fields(FrameConfig) if f.name != "readout")
"""Fields of FrameConfig that ReadoutConfig does not have."""
