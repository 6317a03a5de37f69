"""Frames as network input: rate, bits and preprocessing in the receiver (docs/guide/classifier.md)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from eskin.base.errors import InputError

FrameKind = Literal["frame", "frame-diff", "frame-onoff"]

FRAMES = f"{'|'.join(get_args(FrameKind))}:RATE:BITS"
"""Form of frames on the command line; ON/OFF counts add LEVEL_BITS at the end."""

DEFAULT_LEVEL_BITS = 4


@dataclass(frozen=True, kw_only=True)
class FrameSteps:
    """Frames of all taxels from one shared ADC, with their preprocessing in the receiver.

    All kinds send the same frames: rate_hz * taxels * bits bits per second.
    """

    rate_hz: float = 5000.0
    """Frames per second (paper: 5 kHz)."""
    bits: int = 10
    """Bits of a sample (paper: 10)."""
    frames_per_step: int = 20
    """Number of frames that form one time step of the network. There are taxels * frames_per_step channels; ON/OFF
    counts have 2 * taxels channels, with the counts of these frames added."""
    kind: FrameKind = "frame"
    """Samples in full scales; differences to the frame before in LSB, 0 in the first; or crossings of levels upwards
    and downwards, as level crossing at the receiver counts them from the first frame on."""
    level_bits: int = DEFAULT_LEVEL_BITS
    """For ``frame-onoff``: the distance of levels is 2**-level_bits of full scale, as in LCS with this resolution."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.rate_hz) and self.rate_hz > 0):
            raise InputError(f"rate_hz must be a positive number of hertz, not {self.rate_hz!r}")
        for name, least in (("bits", 3), ("frames_per_step", 1), ("level_bits", 1)):
            if type(getattr(self, name)) is not int or getattr(self, name) < least:
                raise InputError(f"{name} must be at least {least}, not {getattr(self, name)}")
        if self.kind not in get_args(FrameKind):
            raise InputError(f"kind of frames must be one of {', '.join(get_args(FrameKind))}, not {self.kind!r}")
        if self.kind == "frame-onoff" and self.level_bits >= self.bits:
            raise InputError(
                f"level_bits must be below the {self.bits} bits of a sample (sign included), not {self.level_bits}"
            )

    @classmethod
    def parse(cls, text: str, bin_s: float) -> FrameSteps:
        """Return the frames for a text such as ``frame-diff:250:8``.

        Frames that are slower than the bins are a step each.
        """
        kind, *numbers = text.split(":")
        most = 3 if kind == "frame-onoff" else 2
        try:
            digits = all(number.isascii() and number.isdigit() for number in numbers[1:])
            if kind not in get_args(FrameKind) or not 2 <= len(numbers) <= most or not digits:
                raise ValueError
            rate_hz, whole = float(numbers[0]), list(map(int, numbers[1:]))
        except ValueError:
            raise InputError(
                f"frames need KIND:RATE:BITS, with KIND one of {', '.join(get_args(FrameKind))} (the last with "
                f":LEVEL_BITS if wanted), such as frame-diff:250:8, not {text!r}"
            ) from None
        checked = cls(rate_hz=rate_hz, bits=whole[0])
        together = max(1, round(min(checked.rate_hz * bin_s, 1e6)))
        level_bits = whole[1] if len(whole) > 1 else DEFAULT_LEVEL_BITS
        return cls(rate_hz=rate_hz, bits=whole[0], frames_per_step=together, kind=kind, level_bits=level_bits)  # type: ignore[arg-type]

    @property
    def name(self) -> str:
        """Text accepted by ``parse``."""
        levels = f":{self.level_bits}" if self.kind == "frame-onoff" and self.level_bits != DEFAULT_LEVEL_BITS else ""
        return f"{self.kind}:{self.rate_hz:g}:{self.bits}{levels}"

    @property
    def step_s(self) -> float:
        """Seconds per time step of the network."""
        return self.frames_per_step / self.rate_hz
