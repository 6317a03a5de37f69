"""Settings of a readout with the names used in the documents."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


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
    receptive_fields: Any = "own"

    @classmethod
    def of(cls, fields: Mapping[str, Any]) -> Settings:
        """Return settings from a mapping; other fields are ignored."""
        return cls(**{name: fields[name] for name in cls.__dataclass_fields__ if name in fields})

    @property
    def step(self) -> int:
        """D, half an LSB, in codes."""
        return 1 << self.sample_bits - 2 - self.resolution

    @property
    def closing_step(self) -> int:
        """Codes by which a closing window shrinks per step, at least one."""
        return max(self.step // 2**self.closing_shift, 1)

    @property
    def top(self) -> int:
        """Highest code."""
        return (1 << self.sample_bits - 1) - 1

    @property
    def bottom(self) -> int:
        """Lowest code."""
        return -(1 << self.sample_bits - 1)
