"""The settings of a readout, named as in the documents."""

from dataclasses import dataclass


@dataclass
class Settings:
    """Settings of one readout; the defaults are those of the command line's help."""

    rows: int = 8
    columns: int = 8
    encoding: str = "lcs"
    sample_bits: int = 12
    resolution: int = 6
    decide_every: str = "clock"
    reference_reset: int = 0
    closing_shift: int = 2
    window_period: int = 64
    leak_shift: int = 6
    leak_period: int = 63
    fraction_bits: int = 8
    link: str = "stream"
    frontend: str = "digital"
    fields: object = "own"

    @classmethod
    def of(cls, fields):
        """Settings from a mapping that may hold more fields than these."""
        return cls(**{name: fields[name] for name in cls.__dataclass_fields__ if name in fields})

    @property
    def step(self):
        """D, half an LSB, in codes."""
        return 2 ** (self.sample_bits - 2 - self.resolution)

    @property
    def closing_step(self):
        """What a closing window loses at a time, in codes; never below one."""
        return max(self.step // 2**self.closing_shift, 1)

    @property
    def top(self):
        """The highest code."""
        return 2 ** (self.sample_bits - 1) - 1

    @property
    def bottom(self):
        """The lowest code."""
        return -(2 ** (self.sample_bits - 1))
