"""Settings of a readout with the names used in the documents."""

from dataclasses import dataclass


@dataclass
class Settings:
    """Settings of one readout, with the defaults of the command line."""

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
        """Return settings from a mapping; other fields are ignored."""
        return cls(**{name: fields[name] for name in cls.__dataclass_fields__ if name in fields})

    @property
    def step(self):
        """D, half an LSB, in codes."""
        return 2 ** (self.sample_bits - 2 - self.resolution)

    @property
    def closing_step(self):
        """Codes by which a closing window shrinks per step, at least one."""
        return max(self.step // 2**self.closing_shift, 1)

    @property
    def top(self):
        """Highest code."""
        return 2 ** (self.sample_bits - 1) - 1

    @property
    def bottom(self):
        """Lowest code."""
        return -(2 ** (self.sample_bits - 1))
