"""Compare the event counts of several readouts on the same scans."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eskin.snn.data.scans import ScanData


@dataclass(frozen=True)
class Likeness:
    """Agreement of the event counts of two readouts, by taxel and bin."""

    correlation: float
    """Pearson correlation of the counts."""
    ratio: float
    """Ratio of the events of the second readout to the events of the first readout."""


def empty_bins(data: ScanData) -> float:
    """Return the share of bins without an event, over all channels."""
    return float((data.values == 0).mean())


def likeness(first: ScanData, second: ScanData) -> Likeness:
    """Return the agreement of two readouts on the same scans, with ON and OFF counts added.

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
