"""How often a process looks for garbage."""

from __future__ import annotations

import atexit
import gc


def collect_seldom() -> None:
    """Let this process look for garbage seldom, and not at its end.

    Each search goes through the million objects of torch or Numba, which stay: half the time of a start with torch.
    """
    gc.set_threshold(50_000, 20, 100)
    atexit.register(gc.freeze)
