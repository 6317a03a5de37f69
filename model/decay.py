"""When the leak of N-LCS ticks: the staggered phases of the one counter that serves the whole array."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from model.config import ReadoutConfig


def decay_phases(config: ReadoutConfig) -> NDArray[np.int64]:
    """Return, for every row, the phase of its decay tick within the leak period: floor(r * P / rows).

    Row r leaks at sample ticks j (counted from 0 after reset) with ``j mod leak_period == phase[r]``, so the rows
    do not fire together (docs/specification.md, section 2, N-LCS).
    """
    return np.arange(config.rows, dtype=np.int64) * config.leak_period // config.rows
