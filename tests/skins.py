"""Generated recordings of slow piezoresistive skins: raw counts on a large baseline."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

CLASSES = ("press", "stroke", "tap")
BASELINE = (8_000, 12_000)
"""Range of the taxels' counts at rest."""


def touch(kind: str, time_s: NDArray[np.float64], taxel: int) -> NDArray[np.float64]:
    """Return the pressure of a kind of touch on a taxel, 0 to 1."""
    if kind == "press":
        edges = [1 / (1 + np.exp(-4 * (time_s - at - 0.05 * taxel))) for at in (2, 6)]
        return np.asarray(edges[0] - edges[1])
    if kind == "stroke":
        return np.asarray(np.exp(-(((time_s - 1 - 0.3 * taxel) / 0.4) ** 2)))
    return np.asarray(sum(np.exp(-(((time_s - at - 0.02 * taxel) / 0.12) ** 2)) for at in (1, 2.5, 4, 5.5, 7)))


def counts(kind: str, rate_hz: float = 35, taxels: int = 16, seed: int = 0) -> NDArray[np.int64]:
    """Return the counts of eight seconds, shape (ticks, taxels)."""
    random = np.random.default_rng(seed)
    time_s = np.arange(int(8 * rate_hz)) / rate_hz
    gains = random.uniform(2400, 3600, taxels)
    signals = np.stack([touch(kind, time_s, taxel) for taxel in range(taxels)], axis=1) * gains
    return np.rint(signals + random.uniform(*BASELINE, taxels) + random.normal(0, 4, signals.shape)).astype(np.int64)


def write_csv(
    path: Path, values: NDArray[np.int64], rate_hz: float = 35, jitter_s: float = 0.0, separator: str = ","
) -> None:
    """Write counts with a time stamp column in milliseconds and a header."""
    path.parent.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(len(values))
    time_s = np.sort(np.arange(len(values)) / rate_hz + random.uniform(-jitter_s, jitter_s, len(values)))
    header = separator.join(["time_ms", *(f"s{number}" for number in range(values.shape[1]))])
    lines = [
        separator.join([f"{1e3 * at:.3f}".replace(".", "," if separator == ";" else "."), *map(str, row)])
        for at, row in zip(time_s, values.tolist(), strict=True)
    ]
    path.write_text("\n".join([header, *lines]) + "\n")


def write_skin(folder: Path, rate_hz: float = 35, taxels: int = 16, each: int = 3, jitter_s: float = 0.0) -> None:
    """Write a folder with class folders of recordings."""
    for number, kind in enumerate(CLASSES):
        for k in range(each):
            values = counts(kind, rate_hz, taxels, seed=10 * number + k)
            write_csv(folder / kind / f"{k}.csv", values, rate_hz, jitter_s)


def write_uneven(folder: Path, each: int, amplitude: float = 1.0, first: int = 0) -> None:
    """Write recordings whose class appears only in a taxel with a thousandth of the other taxel's range.

    Each class gets ``each`` recordings, numbered from ``first``; ``amplitude`` multiplies all signals.
    """
    for kind, slope in (("slow", 1.0), ("fast", 4.0)):
        for number in range(first, first + each):
            random = np.random.default_rng([len(kind), ord(kind[0]), number])
            loud, quiet = (np.abs((s * np.arange(400) / 100 + random.random()) % 2 - 1) for s in (2.0, slope))
            values = np.rint(amplitude * np.stack([1e6 * loud, 1e3 * quiet], axis=1)).astype(np.int64)
            write_csv(folder / kind / f"{number}.csv", values, rate_hz=100)
