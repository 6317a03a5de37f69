"""Set how often a process collects garbage."""

from __future__ import annotations

import atexit
import gc


def collect_seldom() -> None:
    """Collect garbage rarely in this process, and not at its exit.

    Each search goes through the million objects of torch or Numba, which stay: half the time of a start with torch.
    """
    gc.set_threshold(50_000, 20, 100)
    atexit.register(gc.freeze)
