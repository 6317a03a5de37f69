"""Configure garbage collection in worker processes."""

import atexit
import gc


def collect_seldom() -> None:
    """Make garbage collection rare in this process, and skip it at exit.

    Each search goes through the million objects of torch or Numba, which stay: half the time of a start with torch.
    """
    gc.set_threshold(50_000, 20, 100)
    atexit.register(gc.freeze)
