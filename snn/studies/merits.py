"""Compare readouts by data rate at rest and by timing precision (docs/results/what_events_are_good_for.md)."""

from __future__ import annotations

from typing import Any

from eskin.model.config import ReadoutConfig
from eskin.skin.textures.dataset import Dataset
from eskin.skin.textures.rates import Watch
from eskin.snn.data.frame_steps import FrameSteps
from eskin.snn.studies.rest import bits_per_second
from eskin.snn.studies.timing import timing_points

LCS = ReadoutConfig(encoding="lcs", resolution=3)
READOUTS: dict[str, ReadoutConfig | FrameSteps] = {
    "lcs:3": LCS,
    "cw-lcs:3": ReadoutConfig(encoding="cw-lcs", resolution=3),
    "nlcs:6": ReadoutConfig(encoding="nlcs", resolution=6),
    "frame:500:6": FrameSteps(rate_hz=500.0, bits=6, frames_per_step=2),
}
"""Readouts at rest, by their names in the result."""

NOISES_V = (0.0, 1e-3, 3e-3, 1e-2)
FRAMES_HZ = (250.0, 500.0, 1000.0, 5000.0, 20000.0)
"""Frame rates for the comparison of timing with events."""


def rest_and_timing(textures: Dataset, progress: Watch) -> dict[str, Any]:
    """Return the data rates at rest, the timing errors, and the number of textures."""
    with progress("rest", len(textures) * len(READOUTS)) as step:
        rest = bits_per_second(textures, READOUTS, NOISES_V, step)
    with progress("timing", len(textures)) as step:
        frames = [FrameSteps(rate_hz=rate, bits=8, frames_per_step=1) for rate in FRAMES_HZ]
        timing = timing_points(textures, LCS, frames, step)
    return {"rest": rest, "timing": timing, "textures": len(textures)}
