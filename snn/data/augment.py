"""Augmentation of training scans: time shifts and speed changes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from eskin.base.errors import InputError
from eskin.snn.fields import NetworkFields

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True, kw_only=True)
class AugmentConfig(NetworkFields):
    """Ranges of the random changes applied to every training scan in each epoch.

    Start rows are not drawn here: they are scans of their own (``record_dataset``).
    """

    shift_steps: int = 0
    """The scan moves by -shift_steps..shift_steps steps. What leaves is lost; the steps that enter have no events, or
    repeat the frame at the edge."""
    speed_spread: float = 0.0
    """The scan runs 1 - speed_spread .. 1 + speed_spread times as fast: its events move in time, and none is split or
    made up (``at_speed``)."""
    drop_taxels: float = 0.0
    """Probability with which a taxel is silent for the whole scan."""

    def __post_init__(self) -> None:
        self._check_least("shift_steps", 0)
        if not 0 <= self.speed_spread < 1:
            raise InputError(f"speed_spread must be from 0 to below 1, not {self.speed_spread!r}")
        if not 0 <= self.drop_taxels < 1:
            raise InputError(f"drop_taxels must be a probability below 1, not {self.drop_taxels!r}")


def augment(
    batch: Tensor, taxels: int, config: AugmentConfig, generator: np.random.Generator, frames: bool = False
) -> Tensor:
    """Return an augmented copy of a batch, shape (steps, scans, channels)."""
    import torch

    steps, scans, channels = batch.shape
    if config.speed_spread:
        spread = config.speed_spread
        batch = at_speed(batch, torch.from_numpy(generator.uniform(1 - spread, 1 + spread, scans)).to(batch))
    if config.shift_steps:
        shifts = generator.integers(-config.shift_steps, config.shift_steps + 1, scans)
        source, moved = batch.numpy(), np.empty(batch.shape, np.float32)
        for scan, shift in enumerate(np.clip(shifts, -steps, steps).tolist()):
            first, end = max(shift, 0), steps + min(shift, 0)
            moved[first:end, scan] = source[first - shift : end - shift, scan]
            moved[:first, scan] = source[0, scan] if frames else 0.0
            moved[end:, scan] = source[-1, scan] if frames else 0.0
        batch = torch.from_numpy(moved)
    if config.drop_taxels:
        kept = torch.from_numpy(generator.random((scans, taxels)) >= config.drop_taxels).to(batch)
        batch = batch * kept.repeat(1, channels // taxels)
    return batch


def at_speed(batch: Tensor, speed: Tensor) -> Tensor:
    """Return the counts of scans resampled to other speeds, shape (steps, scans, channels).

    Event k of n in a bin has the position (k - 1/2) / n within the bin. Bin t of a scan at speed v contains the events
    between v t and v (t + 1) bins of the original. Events after the last bin are lost, and a faster scan ends early.
    Plain level crossing would send the same events at that speed. An encoder with a leak or a closing window would send
    others, because its time constants do not scale.

    - ``batch``: shape (steps, scans, channels); whole numbers.
    - ``speed``: shape (scans,); positive; 1 leaves a scan as it is.
    """
    import torch

    steps = len(batch)
    until = torch.cat((batch.new_zeros(1, *batch.shape[1:]), batch.cumsum(0)))  # events before each bin's start
    place = (torch.arange(steps + 1)[:, None] * speed[None, :]).clamp(max=steps)
    lower = place.floor().long().clamp(max=steps - 1)
    part = (place - lower)[:, :, None]
    index = lower[:, :, None].expand(-1, -1, batch.shape[2])
    below = until.gather(0, index)
    return (below + part * (until.gather(0, index + 1) - below) + 0.5).floor().diff(dim=0)
