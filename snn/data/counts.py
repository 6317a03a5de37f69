"""What the event counts of several readouts say of the same scans: how often nothing, and how far the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eskin.snn.data.scans import ScanData


@dataclass(frozen=True)
class Likeness:
    """Two readouts, taxel by taxel and bin by bin of all scans.

    Attributes
    ----------
    correlation : float
        Pearson's, of the counts.
    ratio : float
        Events of the second by those of the first.
    """

    correlation: float
    ratio: float


def empty_bins(data: ScanData) -> float:
    """Return the part of all bins of all channels without an event."""
    return float((data.values == 0).mean())


def likeness(first: ScanData, second: ScanData) -> Likeness:
    """Return how far the counts of two readouts of one encoder agree on the same scans; ON and OFF count together.

    The bins that only one of the two has, at the end, are left out. Encoders whose events count from other times on
    have other bins and cannot be compared.
    """
    steps = min(first.steps, second.steps)
    counts = [
        data.values[:, :steps].reshape(len(data), steps, -1, data.taxels).sum(2, dtype=np.int64).ravel()
        for data in (first, second)
    ]
    correlation = float(np.corrcoef(*counts)[0, 1])
    return Likeness(correlation, float(counts[1].sum() / counts[0].sum()))
